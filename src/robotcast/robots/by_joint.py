"""A diagnosis that looks at groups of joints first, and then within the group that it names."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from robotcast.diagnosis.diagnose import diagnose
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.progress import Progress, silent
from robotcast.robots.library import within
from robotcast.robots.robot_case import RobotCase

Tell = Callable[[dict[str, Any]], object]


def diagnose_by_joint(
    case: RobotCase,
    exclude: Sequence[str],
    fixed: Sequence[str],
    rule: Rule,
    effort: Effort,
    tell: Tell = lambda found: None,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Diagnose a robot; where an effect of a whole group is named, ask each of its joints too.

    The group's effect stands beside those of its joints: it is the simpler answer where all of
    them have it, and stays where no joint's own explains more.
    """
    question = case.question(exclude, fixed, rule, effort)
    found = diagnose(question, tell, progress)
    acting = case.model.effects
    named = [name for name in found["verdict"] if name in acting]
    single = {name: within(case.robot, case.sizes, acting[name]) for name in named}
    if not any(single.values()):
        return found
    case.model.effects = {**acting, **{one.name: one for some in single.values() for one in some}}
    asked = [name for some in single.values() for name in (one.name for one in some)]
    again = diagnose(replace(question, candidates=[*named, *asked]), tell, progress)
    return again if again["verdict"] != found["verdict"] and again["code"] == "named" else found
