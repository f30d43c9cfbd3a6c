"""Is a robot model file possible, is it plausible, and what is the nearest one that is?

`urdf` and `mjcf` read a file without refusing it, `geometry` measures shapes, `bodies`,
`relatives` and `joints` judge, `base` finds what motion reveals, `repair` projects, `rewrite` puts
the result into the text, `inspection` is the door.
"""

from symgen.inspect.inspection import (
    Inspection,
    Row,
    facts,
    inspect_file,
    inspect_text,
    repaired,
)
from symgen.inspect.model import ERROR, WARNING, Body, Finding
from symgen.inspect.repair import Repair
from symgen.inspect.rewrite import write_text

__all__ = [
    "ERROR",
    "WARNING",
    "Body",
    "Finding",
    "Inspection",
    "Repair",
    "Row",
    "facts",
    "inspect_file",
    "inspect_text",
    "repaired",
    "write_text",
]
