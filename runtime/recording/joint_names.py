"""Names of a log's joints and those of the robot, which differ in a prefix: fer_joint1, fr3_joint1.

A prefix is a name of the robot in front of the same words. It is replaced where every joint of the
robot has exactly one counterpart; the step is noted. Other differences are stated in a recipe.
"""

import re
from collections.abc import Collection, Sequence
from itertools import takewhile


def renamed_joints(of_log: Collection[str], robot: Sequence[str]) -> tuple[str, ...]:
    """Names of the log in the order of the robot; () where there are none or several.

    fr3_joint1 … fr3_joint7 → fer_joint1 … fer_joint7: all names of the robot begin with fr3_, and
    of the log exactly one prefix stands before every joint1 … joint7.
    """
    if set(robot) <= set(of_log):
        return tuple(robot)
    ends = zip(min(robot), max(robot), strict=False)
    shared = "".join(a for a, _ in takewhile(lambda pair: pair[0] == pair[1], ends))
    # the word before the number belongs to the name: joint1 and motor1 differ
    common = re.sub(r"[^\W_]*$", "", shared)
    stems = [name.removeprefix(common) for name in robot]
    fronts = {name.removesuffix(stems[0]) for name in of_log if name.endswith(stems[0])}
    whole = [front for front in sorted(fronts) if not front[-1:].isalnum()]
    fitting = [front for front in whole if {front + stem for stem in stems} <= set(of_log)]
    return tuple(fitting[0] + stem for stem in stems) if len(fitting) == 1 else ()


def renaming_note(of_log: Sequence[str], robot: Sequence[str]) -> str:
    """Sentence on joints that were renamed."""
    return (
        f"The joints {of_log[0]} … {of_log[-1]} of the log count as {robot[0]} … {robot[-1]} of "
        "the robot."
    )
