"""Identified parameters → URDF, MJCF, SDF, USD, franka_description YAML and a C header.

`urdf_tree` reads the URDF of the kernels, `fixed_links` divides π between links that are fixed to
each other, `joint_friction` maps friction columns to damping, dry friction and rotor inertia.
`formats` has one module per format; `engines` read a written file again and `reload_check`
compares the result with the compiled library.
"""
