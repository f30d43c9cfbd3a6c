"""Preparation that an inspection proposes: a cut-off whose accelerations the log supports.

Cross-validation orders the candidates (`cutoff_choice`). Proposed is the first of them that
predicts within `WORSE` of the best and whose accelerations pass the check of `regressor_choice`;
where none does, the regressor of momentum, which needs no accelerations.
"""

from dataclasses import replace

from runtime.inspection.cutoff_choice import ROWS_PER_CUTOFF, CutoffChoice, choose_cutoff
from runtime.inspection.finding import INFO, Finding
from runtime.inspection.regressor_choice import choose_regressor, differentiation_of
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recording, Split
from runtime.recording.preprocessing import before_test
from runtime.recording.rest_speeds import as_rest_speed

WORSE = 0.05
"""Excess of a candidate's score over the best one up to which it may replace the chosen one."""
_STEPS = (1, 2, 4, 5, 10, 20, 25, 40, 50, 100, 200, 250, 400, 500, 1000)
"""Factors of decimation that are proposed."""


def proposed_preparation(
    recording: Recording,
    lib: Library,
    preparation: Preparation,
    splitting: Split | None,
    terms: Friction,
) -> tuple[Preparation, list[Finding]]:
    """Choose cut-off, derivative and regressor."""
    choice = choose_cutoff(recording, lib, preparation, splitting, terms)
    findings = [Finding("cutoff", INFO, choice.sentence)]
    seen = before_test(recording, splitting)
    for ready in _candidates(choice):
        quality = differentiation_of(seen, lib, ready)
        if quality is None or not quality.fails:
            if ready != choice.preparation:
                findings.append(_instead(ready, choice))
            return _thinned(ready, recording, lib), findings
    taken, sentences = choose_regressor(seen, lib, choice.preparation, replaces=True)
    findings += [Finding("regressor", INFO, each) for each in sentences]
    return _thinned(taken or choice.preparation, recording, lib), findings


def _candidates(choice: CutoffChoice) -> list[Preparation]:
    """The chosen preparation, then those of the others that predict nearly as well."""
    best = min(c.score for c in choice.candidates)
    near = [c for c in choice.candidates if c.score <= (1.0 + WORSE) * best]
    ready = choice.preparation
    # Trimmed edges follow the cut-off, unless the recipe states them.
    usual_trim = ready.trim_s == 1.0 / choice.chosen.cutoff_hz
    others = [
        replace(
            ready,
            cutoff_hz=c.cutoff_hz,
            derivative=c.derivative,
            trim_s=1.0 / c.cutoff_hz if usual_trim else ready.trim_s,
        )
        for c in sorted(near, key=lambda c: c.score)
    ]
    return [ready, *(each for each in others if each != ready)]


def _instead(ready: Preparation, choice: CutoffChoice) -> Finding:
    """The note that another candidate is proposed."""
    from_q = " with velocities from q" * (ready.derivative == "position")
    return Finding(
        "regressor",
        INFO,
        f"a cut-off of {ready.cutoff_hz:g} Hz{from_q} is proposed instead of "
        f"{choice.chosen.cutoff_hz:g} Hz, at which differentiation fails; it predicts nearly as "
        "well",
    )


def _thinned(ready: Preparation, recording: Recording, lib: Library) -> Preparation:
    """A preparation decimated to the rate that its band needs, without intervals of rest."""
    grid = ready.grid_hz or (1.0 / ready.clock_tick if ready.clock_tick else recording.rate_hz)
    most = grid / (ROWS_PER_CUTOFF * (ready.cutoff_hz or grid))
    step = max(k for k in _STEPS if k <= max(most, 1.0))
    return replace(
        ready,
        trim_s=float(f"{ready.trim_s:.2g}") if ready.trim_s else None,
        rate_hz=float(f"{grid / step:.6g}") if step > 1 else None,
        rest_speed=ready.rest_speed or as_rest_speed(lib),
    )
