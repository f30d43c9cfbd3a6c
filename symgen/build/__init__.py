"""The build: from a request to a compiled library."""
