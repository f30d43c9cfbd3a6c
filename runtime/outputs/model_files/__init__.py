"""Identified parameters → URDF, MJCF, SDF, USD, franka_description YAML and a C header.

`urdf_tree` reads the URDF of the kernels, `fixed_links` divides π between links that are fixed to
each other, `joint_friction` maps friction columns to damping, dry friction and rotor inertia.
`formats` has one module per format; `engines` read a written file again and `reload_check`
compares the result with the compiled library.
"""

from typing import TYPE_CHECKING

from runtime.startup.lazy_names import lazy_names

if TYPE_CHECKING:
    from runtime.outputs.model_files.export import Exported, export_model, write_urdf
    from runtime.outputs.model_files.export_format import EXPORT_FORMATS, ExportFormat
    from runtime.outputs.model_files.formats.urdf import urdf_text
    from runtime.outputs.model_files.model import IdentifiedModel, make_model

__all__ = [
    "EXPORT_FORMATS",
    "ExportFormat",
    "Exported",
    "IdentifiedModel",
    "export_model",
    "make_model",
    "urdf_text",
    "write_urdf",
]

__getattr__ = lazy_names(
    __name__,
    {
        "EXPORT_FORMATS": "runtime.outputs.model_files.export_format",
        "ExportFormat": "runtime.outputs.model_files.export_format",
        "Exported": "runtime.outputs.model_files.export",
        "IdentifiedModel": "runtime.outputs.model_files.model",
        "export_model": "runtime.outputs.model_files.export",
        "make_model": "runtime.outputs.model_files.model",
        "urdf_text": "runtime.outputs.model_files.formats.urdf",
        "write_urdf": "runtime.outputs.model_files.export",
    },
)
