"""Identification of logs that do not fit into memory: blocks of rows, prepared and compressed."""
