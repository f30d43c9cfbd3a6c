"""Errors of both packages: each message says what was expected, what came, what to do."""


class RuntimeFault(Exception):
    """Base of every error that a user can cause; the command line prints it as one sentence."""


class LibraryError(RuntimeFault):
    """The generated library is missing, stale, foreign or damaged."""


class CompilerError(LibraryError):
    """No C compiler is available, or it rejected the generated code."""
