"""A diagnosis that looks at groups of joints first, and then within the group that it names."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from robotcast.diagnosis.diagnose import Case, diagnose
from robotcast.progress import Progress, silent
from robotcast.robots.library import within
from robotcast.robots.robot_case import RobotCase

Tell = Callable[[dict[str, Any]], object]


def diagnose_by_joint(
    case: RobotCase, question: Case, tell: Tell, progress: Progress = silent
) -> dict[str, Any]:
    """Diagnose a robot; where an effect of a whole group is named, try each of its joints alone.

    The group's effect competes with those of its joints: it is as simple as one of them, and
    stays where all joints have it. Whatever else was named is tried beside them.
    """
    found = diagnose(question, tell, progress)
    effects = case.model.effects
    named = [name for name in found["verdict"] if name in effects]
    single = [one for name in named for one in within(case.robot, case.sizes, effects[name])]
    if not single:
        return found
    case.model.effects = {**effects, **{one.name: one for one in single}}
    candidates = [*named, *(one.name for one in single)]
    again = diagnose(replace(question, candidates=candidates), tell, progress)
    kept = again["code"] == "named" and set(again["verdict"]) != set(found["verdict"])
    if not kept:
        tell(found)
        return found
    note = f"First {' + '.join(named)} was named, of a group; then its joints were told apart."
    again["notes"] = [note, *again["notes"]]
    tell(again)
    return again
