"""Kernels → the text of a generated folder, independent of robots and compilers.

`sample` and `ssa` write the code of one kernel for one sample and for tiles, `forms` the calls
between kernels, `programs` the tables of the programs built on them, and `files` bounds the stack
and renders the templates.
"""
