"""Identification of logs that do not fit into memory: blocks of rows, prepared and compressed."""

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
