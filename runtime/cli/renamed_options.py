"""Option names of earlier versions, refused with a sentence that names the present option."""

from contextlib import suppress
from typing import Any

from typer.core import TyperCommand

from runtime.cli.plain_values import without_conversion
from runtime.errors import RuntimeFault

_CONTROLLER = "--controller FILE, the closed-loop description of this log"
_EARLIER_LOG = "--earlier-log LOG; --prior is the inertial prior of identify"
_PAYLOAD_ONLY = "--payload-only; --payload is a body"

RENAMED = {
    "identify": {"--loop": _CONTROLLER},
    "compare": {"--loop": _CONTROLLER},
    "excite": {
        "--payload": _PAYLOAD_ONLY,
        "--plot": "--pictures; --plot is a file",
        "--prior": _EARLIER_LOG,
        "--rate": "--export-rate for exported files, or --log-rate for the log to be recorded",
    },
    "predict": {"--payload": _PAYLOAD_ONLY, "--prior": _EARLIER_LOG},
    "simulate": {
        "--config": "--settings; --config describes a robot to symgen build",
        "--rate": "--control-rate; --rate is the rate to which a log is decimated",
    },
    "view": {"--export": "--html FILE; --export is a kind of file of excite"},
}
"""Command → old option → the option to give instead, and what the old name means now."""


SMALLEST, LARGEST = 1e-12, 1e12
"""Sizes of the numbers of options, besides 0, in SI units: beyond them results overflow."""


class RefusingCommand(TyperCommand):
    """A command that refuses the option names of earlier versions, and numbers of absurd size."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Parameters, which take plain values as they are."""
        return without_conversion(super().get_params(ctx))

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the command line."""
        renamed = RENAMED.get(self.name or "", {})
        for word in args:
            if word == "--":
                break
            name = str(word).partition("=")[0]
            if name in renamed:
                raise RuntimeFault(
                    f"'{self.name}' has no option {name} any more; give {renamed[name]}"
                )
        rest: list[str] = super().parse_args(ctx, args)
        for param in self.params:
            if param.param_type_name == "option" and param.name in ctx.params:
                _require_usual(param.opts[0], ctx.params[param.name])
        return rest


def _require_usual(option: str, value: Any) -> None:
    """Refuse numbers of an option, alone or with commas, beyond `SMALLEST` and `LARGEST`."""
    for each in value if isinstance(value, (list, tuple)) else [value]:
        for word in str(each).split(",") if isinstance(each, (str, float)) else []:
            with suppress(ValueError):  # a name
                size = abs(float(word))
                if 0 < size < SMALLEST or size > LARGEST:
                    raise RuntimeFault(
                        f"{option} expects a number from {SMALLEST:g} to {LARGEST:g} in size, got "
                        f"{word[:40]}; give it in SI units"
                    )
