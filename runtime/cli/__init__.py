"""Commands that use the library of a robot: `python -m runtime COMMAND` or `symgen COMMAND`."""

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
    locate,
    payload,
    predict,
    report,
    reproduce,
    simulate,
    tutorial,
    view,
)
from runtime.cli.common import INTERRUPTED, flowing, program
from runtime.cli.renamed_options import RefusingCommand
from runtime.errors import RuntimeFault

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Identify the inertial parameters of robot arms from measured motion.",
    epilog="`symgen build` compiles the library of a robot, which these commands load.",
)
app.command("inspect", cls=RefusingCommand)(inspect.inspect_command)
app.command("identify", cls=RefusingCommand)(identify.identify_command)
app.command("compare", cls=RefusingCommand)(compare.compare_command)
app.command("payload", cls=RefusingCommand)(payload.payload_command)
app.command("gains", cls=RefusingCommand)(gains.gains_command)
app.command("evaluate", cls=RefusingCommand)(evaluate.evaluate_command)
app.command("export", cls=RefusingCommand)(export.export_command)
app.command("excite", cls=RefusingCommand)(excite.excite_command)
app.command("predict", cls=RefusingCommand)(predict.predict_command)
app.command("simulate", cls=RefusingCommand)(simulate.simulate_command)
app.command("reproduce", cls=RefusingCommand)(reproduce.reproduce_command)
app.command("report", cls=RefusingCommand)(report.report_command)
app.command("view", cls=RefusingCommand)(view.view_command)
app.command("locate", cls=RefusingCommand)(locate.locate_command)
app.command("tutorial", cls=RefusingCommand)(tutorial.tutorial_command)
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
