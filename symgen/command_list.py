"""Names of all commands of `symgen`, each with one sentence and the package that runs it.

`symgen` and `runtime` never import each other, so the packages are named as text.
"""

from dataclasses import dataclass

BUILD, RUN = "symgen.cli", "runtime.cli"
"""Packages of commands: one writes the library of a robot, one uses it."""


@dataclass(frozen=True, slots=True)
class Command:
    """One line of the overview.

    Attributes:
        name: word after `symgen`.
        package: package whose `main` runs it, `BUILD` or `RUN`.
        sentence: first sentence of the command's own help.
        argument: what distinguishes two commands of one name.
    """

    name: str
    package: str
    sentence: str
    argument: str = ""


GROUPS: dict[str, tuple[Command, ...]] = {
    "Build the library of a robot": (
        Command("build", BUILD, "Generate and compile the C library of a robot arm."),
        Command(
            "check", BUILD, "Compare generated files with the C code that symgen writes today."
        ),
        Command("list", BUILD, "List bundled and generated robots."),
        Command("describe", BUILD, "Show joints, limits, base parameters and kernels of a robot."),
        Command(
            "proxies", BUILD, "Fit collision capsules to a robot and choose the pairs to check."
        ),
        Command("clean", BUILD, "Delete compiled libraries and generated folders."),
    ),
    "Check the input": (
        Command("inspect", BUILD, "Check the inertial parameters of a robot model.", "MODEL"),
        Command("inspect", RUN, "Check a log and propose a recipe that reads it.", "LOG"),
        Command("locate", RUN, "Print the folder of a known data set or of a robot."),
    ),
    "Plan a motion": (
        Command("excite", RUN, "Design an excitation motion within all limits of a robot."),
        Command("approach", RUN, "Plan the way to the start of a motion and back."),
        Command("predict", RUN, "Predict the accuracy that a motion or a log allows."),
        Command("simulate", RUN, "Simulate the log of a robot with known parameters."),
        Command(
            "campaign",
            RUN,
            "Design, run and identify until a target is reached, on a virtual or real arm.",
        ),
    ),
    "Identify": (
        Command("identify", RUN, "Identify the inertial parameters of a robot from logs."),
        Command("friction", RUN, "Identify friction anew and keep the links of an earlier result."),
        Command("payload", RUN, "Identify mass, centre of mass and inertia of a payload."),
        Command("gains", RUN, "Identify gain and bias of every torque sensor or drive."),
        Command("fleet", RUN, "Compute the prior of a type of robot from many units of it."),
        Command("compare", RUN, "Compare all identification methods on one log."),
    ),
    "Use a result": (
        Command("evaluate", RUN, "Evaluate an identified model on another log."),
        Command("observe", RUN, "Compute the external torque of a log and find contacts."),
        Command("watch", RUN, "Test whether a robot has changed since its model was identified."),
        Command("sample", RUN, "Draw models from the posterior of an identification."),
        Command("export", RUN, "Export an identified model to simulators and controllers."),
        Command("report", RUN, "Write the results of a folder as one HTML page."),
        Command("view", RUN, "Show the moving robot in a web browser."),
    ),
    "Learn": (
        Command("tutorial", RUN, "Show a tutorial."),
        Command("reproduce", RUN, "Reproduce the tables and figures of the document."),
    ),
}
"""All commands in the order of the overview."""
