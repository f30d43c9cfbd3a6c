"""Kernels → the text of a generated folder, independent of robots and compilers."""
