"""Run of the checks of one log: the plan so far, the log read with it, and the findings."""

from collections.abc import Callable
from dataclasses import replace

from runtime.inspection.checks.torque_rows import TorqueRows, rough, torque_rows_of
from runtime.inspection.finding import Finding
from runtime.library import Library
from runtime.recording import Friction, Recipe, Recording
from runtime.recording.reader import Raw, recording_of


class CheckRun:
    """The plan so far, the recording read with it, and the findings."""

    def __init__(
        self, raw: Raw, plan: Recipe, findings: list[Finding], *, has_gains: bool = True
    ) -> None:
        """Read the log with the plan."""
        self._raw, self.plan, self.findings = raw, plan, findings
        self.has_gains = has_gains
        self.recording = recording_of(replace(raw, plan=plan))

    def run(self, check: Callable[[Recording, Recipe], tuple[Recipe, list[Finding]]]) -> None:
        """Run a check, and read the log again where it changes the plan."""
        plan, findings = check(self.recording, self.plan)
        self.findings += findings
        if plan != self.plan:
            self.plan = plan
            self.recording = recording_of(replace(self._raw, plan=plan))

    def run_on_torque(
        self,
        check: Callable[[TorqueRows, Recipe], tuple[Recipe, list[Finding]]],
        lib: Library,
        terms: Friction,
    ) -> None:
        """Run a check of the torque on prepared rows."""
        torque_rows = self.torque_rows(lib, terms)
        self.run(lambda _, plan: check(torque_rows, plan))

    def torque_rows(self, lib: Library, terms: Friction) -> TorqueRows:
        """Prepared rows of the recording, read with the plan so far."""
        usual = rough(self.recording, self.plan.preparation)
        return torque_rows_of(self.recording, lib, usual, terms)
