"""Commands that use the library of a robot: `python -m runtime COMMAND` or `symgen COMMAND`."""

from runtime import __version__
from runtime.common.commands import Commands, application, run
from runtime.common.terminal import program


class RunCommands(Commands):
    """Commands that use the library of a robot."""

    package = "runtime"


app = application(
    RunCommands,
    "Identify the inertial parameters of robot arms from measured motion. "
    "`symgen build` compiles the library of a robot, which these commands load.",
    __version__,
)


def main() -> None:
    """Run the command line; a `RuntimeFault` becomes one sentence and exit code 2."""
    run(app, program().split()[-1])
