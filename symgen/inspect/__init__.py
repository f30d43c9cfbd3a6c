"""Check of a robot model file: physical consistency, plausibility, and the nearest consistent file.

`reading` reads a file without rejecting it; `geometry` measures shapes; `checks` and `comparison`
check; `base` computes base parameters; `repair` projects; `rewrite` writes the result into the
text; `inspection` combines them.
"""
