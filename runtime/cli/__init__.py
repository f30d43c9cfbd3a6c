"""`python -m runtime COMMAND`: inspect, identify, compare, payload, export, excite and others."""

import sys
from inspect import getdoc

import typer

from runtime.cli import (
    compare,
    evaluate,
    excite,
    export,
    gains,
    identify,
    inspect,
    payload,
    predict,
    report,
    reproduce,
    simulate,
    tutorial,
    view,
)
from runtime.cli.common import INTERRUPTED, flowing, program
from runtime.errors import RuntimeFault

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Find the true inertial parameters of a robot arm from measured motion.",
    epilog="The robot's library comes from: python -m symgen build",
)
app.command("inspect")(inspect.inspect_command)
app.command("identify")(identify.identify_command)
app.command("compare")(compare.compare_command)
app.command("payload")(payload.payload_command)
app.command("gains")(gains.gains_command)
app.command("evaluate")(evaluate.evaluate_command)
app.command("export")(export.export_command)
app.command("excite")(excite.excite_command)
app.command("predict")(predict.predict_command)
app.command("simulate")(simulate.simulate_command)
app.command("reproduce")(reproduce.reproduce_command)
app.command("report")(report.report_command)
app.command("view")(view.view_command)
app.command("locate")(evaluate.locate_command)
app.command("tutorial")(tutorial.tutorial_command)
for command in app.registered_commands:
    command.help = flowing(getdoc(command.callback) or "")


def main() -> None:
    """Run the command line; a `RuntimeFault` becomes one sentence and exit code 2."""
    name = program().split()[-1]
    try:
        app()
    except RuntimeFault as error:
        print(f"{name}: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except SystemExit as end:
        if end.code == INTERRUPTED:
            print(
                f"{name}: interrupted; files that were finished before stay as they are",
                file=sys.stderr,
            )
        raise


__all__ = ["app", "main"]
