"""Identified parameters → URDF, MJCF, SDF, franka_description YAML and a C header.

`tree` reads the URDF of the kernels, `split` gives every link its body, `drive` turns friction
into what simulators know, one module per format writes, `engines` read again, `check` compares.
"""

from runtime.outputs.model_files.model import Model, make_model
from runtime.outputs.model_files.urdf import urdf_text
from runtime.outputs.model_files.write import FORMATS, Exported, Format, export_model, write_urdf

__all__ = [
    "FORMATS",
    "Exported",
    "Format",
    "Model",
    "export_model",
    "make_model",
    "urdf_text",
    "write_urdf",
]
