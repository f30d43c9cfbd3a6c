"""The programs that read model files: what each one read; None where it is not installed.

In outputs, only these modules may import pinocchio, mujoco, pydrake, pxr and yaml.
"""
