"""Drawing the cases of the benchmark from one seed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotcast.hidden_effects.case import Case
from robotcast.hidden_effects.mechanisms import LIBRARY, MECHANISMS, OUTSIDE


@dataclass(frozen=True)
class Control:
    """A case that hides nothing.

    Attributes
    ----------
    varied : whether the cable differs from the configured one, as it does in all other cases.
    """

    cable: str
    varied: bool = True
    outliers: int = 0
    noise_s: float = 0.0


@dataclass(frozen=True)
class Strength:
    """How strongly effects are hidden: how far they move the paths, in noise floors."""

    name: str
    noise_floors: float


@dataclass(frozen=True)
class Composition:
    """What the benchmark is made of.

    Attributes
    ----------
    noise_floor_percent : cable → average waypoint deviation of repeats in % of its length; the
        cables that cases with something hidden are drawn from.
    vary : number of `CableTruth` → standard deviation of its logarithm from case to case.
    strengths : from weak to strong.
    effects, draws : every one of `effects` is hidden at every strength, `draws` times.
    controls, pairs, outside : the other cases; pairs and outside at the last strength.
    """

    noise_floor_percent: Mapping[str, float]
    vary: Mapping[str, float]
    strengths: Sequence[Strength]
    effects: Sequence[str]
    draws: int
    controls: Sequence[Control]
    pairs: Sequence[Sequence[str]]
    outside: Sequence[str]

    def __post_init__(self) -> None:
        named = [*self.effects, *(name for pair in self.pairs for name in pair)]
        for names, known, what in ((named, LIBRARY, "effects"), (self.outside, OUTSIDE, "outside")):
            wrong = [name for name in names if name not in known]
            if wrong:
                raise ValueError(
                    f"hidden effects: {wrong[0]} is none of the {what} that can be hidden: "
                    f"{', '.join(known)}"
                )


def draw_cases(composition: Composition, seed: int) -> list[Case]:
    """Draw every case; their order, and so their names, tell nothing."""
    cases = list(_cases(composition, seed))
    order = np.random.default_rng([seed, 0]).permutation(len(cases))
    return [replace(cases[row], name=f"case-{n:03d}") for n, row in enumerate(order, 1)]


def _cases(composition: Composition, seed: int) -> Iterator[Case]:
    number = 0

    def dealt(**given) -> tuple[np.random.Generator, dict]:
        nonlocal number
        number += 1
        random = np.random.default_rng([seed, number])
        return random, {"name": "", "seed": int(random.integers(2**31)), **given}

    for control in composition.controls:
        random, common = dealt(kind="control", cable=control.cable)
        yield Case(
            **common,
            truth=_varied(composition, random) if control.varied else {},
            outliers=control.outliers,
            noise_s=control.noise_s,
        )
    strongest = composition.strengths[-1:]
    groups = [
        *(("single", [e], s) for e in composition.effects for s in composition.strengths)
    ] * composition.draws
    groups += [("pair", list(pair), s) for pair in composition.pairs for s in strongest]
    groups += [("outside", [name], s) for name in composition.outside for s in strongest]
    for kind, names, strength in groups:
        random, common = dealt(kind=kind)
        cable = str(random.choice(list(composition.noise_floor_percent)))
        yield Case(
            **common,
            cable=cable,
            truth=_varied(composition, random),
            hidden={name: MECHANISMS[name].place(random) for name in names},
            strength=strength.name,
            wanted_percent=strength.noise_floors * composition.noise_floor_percent[cable],
        )


def _varied(composition: Composition, random: np.random.Generator) -> dict[str, float]:
    return {
        name: float(np.exp(spread * random.standard_normal()))
        for name, spread in composition.vary.items()
    }
