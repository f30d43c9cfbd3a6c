"""Names of links and joints within generated text: they come from a URDF and may hold anything."""

import html
import re


def in_comment(name: str) -> str:
    """Name within a comment of C.

    `*/` ends a comment; so do its spellings by a trigraph (`??/` is a backslash) and a line splice.
    """
    return re.sub(r"[*?\\]|[^\S ]|[^\w\s!-~]", "_", name)


def in_markdown(name: str) -> str:
    """Name within a paragraph or a cell of a table in Markdown."""
    flat = "".join(c if c.isprintable() else "_" for c in name)
    return re.sub(r"([\\`*\[\]|])", r"\\\1", html.escape(flat, quote=False))


def in_code(name: str) -> str:
    """Name within a code span of Markdown, where nothing can be escaped."""
    return re.sub(r"[`<>]|[^\S ]", "_", name)
