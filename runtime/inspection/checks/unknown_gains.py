"""Motor currents whose recipe states no gain (trap 11).

The checks read them with gain 1; `torque_signs.scale` compares them with the model. The recipe
stays without gains, which `identify` estimates from the rows before the test part.
"""

from dataclasses import replace

from runtime.inspection.finding import INFO, Finding
from runtime.recording import Recipe
from runtime.recording.reader import Raw


def with_gain_one(raw: Raw, plan: Recipe) -> tuple[Raw, Recipe]:
    """The log with currents counted as torques of gain 1."""

    def known(recipe: Recipe) -> Recipe:
        if recipe.torque is None or not recipe.has_unknown_gains:
            return recipe
        return recipe.replace(torque=replace(recipe.torque, gain=1.0))

    recipe = None if raw.recipe is None else known(raw.recipe)
    return replace(raw, plan=known(raw.plan), recipe=recipe), known(plan)


def stated(plan: Recipe, findings: list[Finding]) -> tuple[Recipe, list[Finding]]:
    """The recipe without gains, and "current_gains" in place of the finding on the unit."""
    seen = next((each for each in findings if each.kind == "torque_unit"), None)
    rest = [each for each in findings if each.kind != "torque_unit"]
    sentence = (
        "the torque is a motor current in A with unknown gains: identify estimates them "
        "with the masses of the URDF as prior and states what remains undetermined; symgen gains "
        "fixes the common factor by --total-mass, --weighed or a known payload"
    )
    evidence = {} if seen is None else dict(seen.evidence)
    stated_gains = Finding("current_gains", INFO, sentence, evidence, trap=11)
    torque = None if plan.torque is None else replace(plan.torque, gain=None)
    return plan.replace(torque=torque), [*rest, stated_gains]
