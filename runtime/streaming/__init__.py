"""Identification of logs that do not fit into memory: blocks of rows, prepared and compressed."""

from runtime.streaming.blocks import Blocks, blocks_of, head_of
from runtime.streaming.identify import identify_streamed

__all__ = ["Blocks", "blocks_of", "head_of", "identify_streamed"]
