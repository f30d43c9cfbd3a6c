"""Identification of logs that do not fit into memory: blocks of rows, prepared and compressed."""

from typing import TYPE_CHECKING

from runtime.startup.lazy_names import lazy_names

if TYPE_CHECKING:
    from runtime.identification.long_logs.blocks import Blocks, blocks_of, head_of
    from runtime.identification.long_logs.identify import (
        StreamedAssembly,
        assemble_streamed,
        identify_streamed,
        require_streamable,
    )

__all__ = [
    "Blocks",
    "StreamedAssembly",
    "assemble_streamed",
    "blocks_of",
    "head_of",
    "identify_streamed",
    "require_streamable",
]

__getattr__ = lazy_names(
    __name__,
    {
        "Blocks": "runtime.identification.long_logs.blocks",
        "StreamedAssembly": "runtime.identification.long_logs.identify",
        "assemble_streamed": "runtime.identification.long_logs.identify",
        "blocks_of": "runtime.identification.long_logs.blocks",
        "head_of": "runtime.identification.long_logs.blocks",
        "identify_streamed": "runtime.identification.long_logs.identify",
        "require_streamable": "runtime.identification.long_logs.identify",
    },
)
