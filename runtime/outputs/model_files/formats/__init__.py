"""One module per model file format: how the file is written, how it is checked, its record."""
