"""What can be hidden, how the cases of the benchmark are drawn from one seed, and their answers.

An effect with a name in the library is drawn with the library's parameters, in their units and
meaning, so that an answer can be compared with a diagnosis number by number. This side knows the
virtual rig's hidden effects and nothing of robotcast.effects and robotcast.diagnosis.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import numpy as np

from robotcast.casts.action import Action
from robotcast.rigs.virtual.hiding import LIBRARY, MECHANISMS, OUTSIDE, make_effect
from robotcast.rigs.virtual.rig import VirtualRig


@dataclass(frozen=True)
class Case:
    """What a case is made of, before anything is simulated."""

    name: str  # says nothing about what is hidden
    # nothing hidden, one effect or two of the library, one mechanism outside it
    kind: Literal["control", "single", "pair", "outside"]
    cable: str  # which of the rigs it is measured on
    seed: int  # of its actions and of the rig's chance
    # how many times as large as the cable's own each of these numbers of `CableTruth` is
    truth: Mapping[str, float] = field(default_factory=dict)
    # mechanism → its place (`Mechanism.place`); its size is fitted to `wanted_percent`
    hidden: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    strength: str = ""  # how the size is called, "" where nothing is hidden
    wanted_percent: float = 0.0  # of cable length, that each hidden mechanism shall move the paths
    outliers: int = 0  # casts whose tracking went astray
    noise_s: float = 0.0  # growth of the tracking noise with speed [m per m/s]

    def rig(self, nominal: VirtualRig, hidden: Mapping[str, Mapping[str, float]]) -> VirtualRig:
        """Return the rig of this case with `hidden` (mechanism → parameters) at work."""
        factors = {name: getattr(nominal.truth, name) * f for name, f in self.truth.items()}
        return replace(
            nominal,
            truth=replace(nominal.truth, **factors),
            seed=self.seed,
            hidden=tuple(make_effect(name, given) for name, given in hidden.items()),
        )


def draw_cases(composition: Mapping[str, Any], seed: int) -> list[Case]:
    """Draw every case of a composition (full.yaml); their order, and so their names, tell nothing.

    Every effect is hidden at every strength, `draws` times; pairs and what is outside the library
    at the last one. Raises ValueError for an effect that cannot be hidden.
    """
    named = [*composition["effects"], *chain.from_iterable(composition["pairs"])]
    outside = composition["outside"]
    for names, known, what in ((named, LIBRARY, "effects"), (outside, OUTSIDE, "outside")):
        if wrong := [name for name in names if name not in known]:
            raise ValueError(
                f"hidden effects: {wrong[0]} is none of the {what} that can be hidden: "
                f"{', '.join(known)}"
            )
    cases = list(_cases(composition, seed))
    order = np.random.default_rng([seed, 0]).permutation(len(cases))
    return [replace(cases[row], name=f"case-{n:03d}") for n, row in enumerate(order, 1)]


def _cases(composition: Mapping[str, Any], seed: int) -> Iterator[Case]:
    floors, strengths = composition["noise_floor_percent"], composition["strengths"]
    singles = [("single", [e], s) for e in composition["effects"] for s in strengths]
    groups = [("control", control, None) for control in composition["controls"]]
    groups += singles * composition["draws"]
    groups += [("pair", pair, s) for pair in composition["pairs"] for s in strengths[-1:]]
    groups += [("outside", [name], s) for name in composition["outside"] for s in strengths[-1:]]
    for number, (kind, what, strength) in enumerate(groups, 1):
        random = np.random.default_rng([seed, number])
        case = Case("", kind, "", int(random.integers(2**31)))
        if strength is None:
            given = dict(what)
            truth = _varied(composition, random) if given.pop("varied", True) else {}
            yield replace(case, **given, truth=truth)
            continue
        cable = str(random.choice(list(floors)))
        yield replace(
            case,
            cable=cable,
            truth=_varied(composition, random),
            hidden={name: MECHANISMS[name].place(random) for name in what},
            strength=strength["name"],
            wanted_percent=strength["noise_floors"] * floors[cable],
        )


def _varied(composition: Mapping[str, Any], random: np.random.Generator) -> dict[str, float]:
    return {
        name: float(np.exp(spread * random.standard_normal()))
        for name, spread in composition["vary"].items()
    }


def choose_actions(
    feasible: np.ndarray,
    random: np.random.Generator,
    *,
    actions: int,
    repeated: int,
    times: int,
    alike: float = 1.0,
) -> list[tuple[int, Action]]:
    """Draw the casts (action_id, action) of a case from the feasible actions (m, 6).

    So many distinct `actions` are drawn; `repeated` of them are cast so many `times`, to show the
    noise floor; the repeats come last. They are drawn from a share `alike` of the feasible ones:
    those nearest to one of them, all to one side of the board. 1 draws from all, half of them
    mirrored.
    """
    if not 0 < alike <= 1:
        raise ValueError(f"hidden effects: expected 0 < alike ≤ 1, got {alike:g}")
    if not 0 <= repeated <= actions or actions < 1 or times < 1:
        raise ValueError(
            "hidden effects: expected 0 ≤ repeated ≤ actions and times ≥ 1, got "
            f"{repeated} of {actions} actions {times} times"
        )
    if alike < 1:
        ranges = np.maximum(np.ptp(feasible, axis=0), 1e-9)
        centre = feasible[random.integers(len(feasible))]
        away = np.linalg.norm((feasible - centre) / ranges, axis=1)
        feasible = feasible[np.argsort(away, kind="stable")[: round(alike * len(feasible))]]
    if actions > len(feasible):
        raise ValueError(f"hidden effects: {actions} actions wanted, {len(feasible)} are feasible")
    rows = random.permutation(len(feasible))[:actions]
    mirrored = (random.permutation(actions) < actions // 2) & (alike == 1)
    drawn = [Action.from_array(feasible[row]) for row in rows]
    drawn = [a.mirrored() if m else a for a, m in zip(drawn, mirrored, strict=True)]
    again = np.repeat(np.arange(repeated), times - 1)
    return [(int(n), drawn[n]) for n in (*range(actions), *again)]


def answer_path(case: str, reports: Path) -> Path:
    """Return where the sealed answer of a case lies."""
    return reports / "answers" / f"{case}.sealed"
