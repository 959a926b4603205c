"""What to do next, one kind of advice for every state of the page."""

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

from robotcast.reporting.diagnosis.evidence import State, readable, rivals
from robotcast.reporting.diagnosis.reading import Diagnosis
from robotcast.reporting.names import effect_name


@dataclass(frozen=True)
class Step:
    """One thing to do.

    Attributes
    ----------
    text : in plain words.
    command : to type, empty when there is nothing to type.
    link : (address, words) of where to look, or None.
    trials : how many of the next trials to list below the step.
    """

    text: str
    command: str = ""
    link: tuple[str, str] | None = None
    trials: int = 0


def next_steps(diagnosis: Diagnosis, state: State) -> tuple[Step, ...]:
    """Return what to do, in order."""
    steps = {
        "running": _wait,
        "too few": _measure_more,
        "unknown": _write_an_effect,
        "none": _carry_on,
        "near": _confirm,
        "open": _look_on,
        "confused": _tell_apart,
        "found": _add,
    }
    return tuple(steps[state](diagnosis))


def add_command(diagnosis: Diagnosis, effects: Sequence[str]) -> str:
    """Return the command that tunes the model with `effects` to the same measurement set."""
    folder = diagnosis.measurements if "/" in diagnosis.measurements else "DIR"
    tuned = f"{_outputs(diagnosis)}/{'+'.join(effects)}"
    own = f"paths.diagnosis={shlex.quote(diagnosis.output)} " if diagnosis.output else ""
    chosen = "".join(f"{shlex.quote(override)} " for override in diagnosis.overrides)
    return (
        f"python stages/tune.py {chosen}paths.measurements={shlex.quote(folder)} {own}"
        f"paths.tuned={tuned} 'effects=[{','.join(effects)}]'"
    )


def pipeline_command(diagnosis: Diagnosis) -> str:
    """Return the command that runs the pipeline with what was found.

    To DVC a bare comma is a sweep. A simulator that was chosen for the diagnosis runs alone: others
    may lack other effects.
    """
    effects = diagnosis.model
    names = ",".join(effects)
    chosen = f"effects={names}" if len(effects) == 1 else f"\"effects='{names}'\""
    of = [o.removeprefix("simulator=") for o in diagnosis.overrides if o.startswith("simulator=")]
    alone = "".join(f" -S 'simulators=[{s}]' -S generate.simulator={s}" for s in of)
    return f"dvc exp run -S {chosen}{alone}"


def _outputs(diagnosis: Diagnosis) -> str:
    """Return a folder for all that is tuned to this set, so that its revisions compare."""
    name = re.sub(r"[^\w.-]+", "_", PurePosixPath(diagnosis.measurements).name)
    return f"outputs/{name or 'set'}"


def _folder(diagnosis: Diagnosis) -> str:
    """Say what the reader must fill in."""
    return "" if "/" in diagnosis.measurements else "DIR is the folder of this measurement set. "


def _add_command(diagnosis: Diagnosis) -> str:
    """Return the command of `add_command` for all that was found; none without the stages."""
    return add_command(diagnosis, diagnosis.model) if diagnosis.pipeline else ""


def _wait(diagnosis: Diagnosis) -> list[Step]:
    return [
        Step(f"Nothing yet. The run is at: {readable(diagnosis, diagnosis.doing)}."),
        Step("This page reloads itself every 3 seconds and fills from the top."),
    ]


def _add(diagnosis: Diagnosis) -> list[Step]:
    names = " and ".join(effect_name(e) for e in diagnosis.found)
    if not diagnosis.pipeline:
        return [_let_act(diagnosis, names)]
    steps = [
        Step(
            f"Add {names} and tune again. {_folder(diagnosis)}Watch the error fall in "
            f"{_outputs(diagnosis)}/revisions.html.",
            add_command(diagnosis, diagnosis.model),
        ),
        Step(
            "Through the pipeline, so that generated casts and policies have it too:",
            pipeline_command(diagnosis),
        ),
    ]
    if diagnosis.next_trials:
        trials = diagnosis.words["trials"]
        steps.append(Step(f"To be surer, run more {trials}:", link=("#next", f"which {trials}")))
    return steps


def _let_act(diagnosis: Diagnosis, names: str) -> Step:
    """Say how to go on with a model that the stages do not know."""
    return Step(
        f"Let {names} act from the start and diagnose again: the error falls, and what else is "
        "missing shows. In the code:",
        f"fixed={list(diagnosis.model)}",
    )


def _tell_apart(diagnosis: Diagnosis) -> list[Step]:
    found = " and ".join(effect_name(e) for e in diagnosis.found)
    others = " and ".join(effect_name(e) for e in rivals(diagnosis))
    trials = diagnosis.words["trials"]
    if diagnosis.next_trials:
        first = Step(
            f"Run these {trials}: on them {found} and {others} predict different paths. Then "
            f"diagnose again with the new {trials} in the set.",
            link=_all_of_them(diagnosis),
            trials=3,
        )
    else:
        first = Step(
            f"To be sure, measure {found} itself: in these {trials} {others} would leave "
            "almost the same trace."
        )
    if not diagnosis.pipeline:
        return [first, _let_act(diagnosis, found)]
    until = Step(
        f"Until then {found} fits best: add it and tune again. {_folder(diagnosis)}Watch the "
        f"error fall in {_outputs(diagnosis)}/revisions.html.",
        add_command(diagnosis, diagnosis.model),
    )
    return [first, until]


def _write_an_effect(diagnosis: Diagnosis) -> list[Step]:
    steps = []
    if diagnosis.found:
        folder = _folder(diagnosis) if diagnosis.pipeline else ""
        text = f"Keep what was found. {folder}".strip()
        steps.append(Step(text, _add_command(diagnosis)))
    if diagnosis.unexplained and diagnosis.unexplained.field:
        steps.append(Step("Look at the missing force and guess its law:", link=("#field", "field")))
    if diagnosis.pipeline:
        text = "Write it as an effect: one class and one YAML file; a start is written below."
        steps.append(Step(text, link=("#write", "how to write it")))
    else:
        steps.append(Step("Write it as one more candidate of your model."))
    steps.append(Step("Diagnose again. The new effect is tested like every other."))
    if diagnosis.next_trials:
        steps.append(Step("Or measure more where it shows:", link=("#next", _next(diagnosis))))
    return steps


def _next(diagnosis: Diagnosis) -> str:
    return f"next {diagnosis.words['trials']}"


def _confirm(diagnosis: Diagnosis) -> list[Step]:
    """Say which trials would confirm what came near."""
    nearest = " or ".join(effect_name(e) for e in diagnosis.nearest)
    trials = diagnosis.words["trials"]
    again = f"diagnose again with the new {trials} in the set."
    if not diagnosis.next_trials:
        return [Step(f"Measure more {trials}, with repeats: it may be {nearest}. Then {again}")]
    text = f"Run these {trials}, on which {nearest} would show most. Then {again}"
    return [Step(text, link=_all_of_them(diagnosis), trials=3)]


def _look_on(diagnosis: Diagnosis) -> list[Step]:
    """Say what to do where error is left that nothing explains, or that nobody can judge."""
    words = diagnosis.words
    if diagnosis.noise_floor is None:
        text = f"Repeat five {words['groups']} three times each, so that the noise floor is known."
        steps = [Step(f"{text} Then diagnose again with the new {words['trials']} in the set.")]
    else:
        text = (
            "Use the model where an error of this size does no harm. What is left may be what any "
            "model of this make misses, or something that has no name here."
        )
        steps = [Step(text)]
    if diagnosis.comparison:
        steps.append(Step("See where the error that is left lies:", link=("#where", "where")))
    if diagnosis.next_trials:
        steps.append(Step("Measure more where it may show:", link=("#next", _next(diagnosis))))
    return steps


def _carry_on(diagnosis: Diagnosis) -> list[Step]:
    steps = [Step("Use the model as it is: no effect of the library would make it better.")]
    if diagnosis.next_trials:
        text = (
            f"Some effects could hide in these {diagnosis.words['trials']}. Others would show them:"
        )
        steps.append(Step(text, link=("#next", _next(diagnosis))))
    if diagnosis.comparison:
        steps.append(Step("See where the error that is left lies:", link=("#where", "where")))
    return steps


def _measure_more(diagnosis: Diagnosis) -> list[Step]:
    words = diagnosis.words
    steps = [
        Step(
            f"Measure more: at least 30 {words['trials']} of different {words['groups']}, and "
            "three repeats of each of five of them, so that the noise floor is known. Then "
            "diagnose again."
        )
    ]
    if diagnosis.next_trials:
        steps.append(Step("Start with these:", link=_all_of_them(diagnosis), trials=3))
    return steps


def _all_of_them(diagnosis: Diagnosis) -> tuple[str, str]:
    """Return where all of the next trials stand."""
    if diagnosis.pipeline:
        return "actions.csv", "actions.csv: all of them"
    return "#next", "all of them"
