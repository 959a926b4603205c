"""The numbers that decide a diagnosis, and those that say how hard it tries."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Slicing:
    """Which parts of the trials are said to hold most of the error; no verdict hangs on these.

    Attributes
    ----------
    level : chance that any part is named when the error depends on nothing.
    most : parts named at most.
    excess : of the squared error that must be more than repeats scatter.
    beyond, times : a part's share of the error minus, and over, its share of the samples.
    least, largest : share of the samples that a part holds.
    fewest : trials that a part touches, and that tell what is usual.
    outstanding : times what nine trials in ten stay below: a trial that is named alone.
    moving : of a trial's highest speed: slower, and it has no heading.
    steady : of its root mean square, from which a mean error has a sign.
    """

    level: float = 0.01
    most: int = 5
    excess: float = 0.2
    beyond: float = 0.1
    times: float = 1.3
    least: float = 0.05
    largest: float = 0.75
    fewest: int = 3
    outstanding: float = 3.0
    moving: float = 0.1
    steady: float = 0.5


SLICING = Slicing()


@dataclass(frozen=True)
class Rule:
    """The decision, number by number: docs/decision.md says it, conf/diagnosis.yaml sets it.

    Attributes
    ----------
    level : chance of naming anything where nothing is missing, shared by all effects tried.
    equal : p-value above which two models explain the trials equally well.
    material : of the base model's typical error, or of none's where that predicts better: what
        takes away less does not matter.
    at_floor : times what repeats differ by: up to there a model is as good as its data.
    beyond : times what repeats differ by: above, something is missing whatever explains it. Below
        it may be what two honest models of one thing differ by.
    most_effects : the most that are named together; more would explain anything.
    mostly : of what a model misses beyond the floor: effects that take away less of it explain
        too little to be named where the rest stays above the floor; a field that takes away more
        of what they leave refutes them. Of what matters: a gain that is looked into further. And
        of what is missed if nothing acts: what is left beside a base model that misses more.
    fewest_groups : different trials below which nothing can be held back and tested.
    blunder : times the typical error: a trial of which even the best quarter is missed by more
        was measured wrongly.
    drift : p-value below which repeats that lie far apart in the session differ by more than
        those that follow each other.
    close : of the session: repeats no farther apart follow each other.
    least_noise : of the distance that the signal moves: less noise is not believed.
    enough_power : chance of being noticed from which an effect that was not is called absent.
    faint : of the noise: an effect that moves every trial by less touches nothing.
    distinct : of an effect's sensitivity that the model's own parameters must not imitate.
    far : standard deviations beyond which a group's gain is drawn in before it is tested.
    stray : times the repeats' usual deviation: so far away, a trial is no repeat.
    discrepancy : of what a model misses in a usual trial, that may be the same in all of them
        and shift its parameters.
    decides : squared noise by which two models must differ on the next trials together.
    at_bound : of a parameter's range: so near its end, a fit was pushed there.
    ignored : of the noise: a parameter whose range moves no trial by more is ignored.
    """

    level: float = 0.05
    equal: float = 0.05
    material: float = 0.15
    at_floor: float = 1.5
    beyond: float = 3.0
    most_effects: int = 3
    mostly: float = 0.5
    fewest_groups: int = 8
    blunder: float = 10.0
    drift: float = 0.01
    close: float = 0.25
    least_noise: float = 0.003
    enough_power: float = 0.8
    faint: float = 0.02
    distinct: float = 0.05
    far: float = 4.0
    stray: float = 20.0
    discrepancy: float = 0.5
    decides: float = 4.0
    at_bound: float = 0.005
    ignored: float = 1e-4


@dataclass(frozen=True)
class Effort:
    """How hard a diagnosis tries; no verdict hangs on these but through how well it fits.

    Attributes
    ----------
    base, library, refit, fold : iterations of the fits of the base model, of the whole library,
        of a few effects, and without a fold.
    rounds, pays : a refit to beginnings goes on so often while that lowers its loss by that share.
    folds : parts of the trials that are held out in turn.
    early, some : share of every trial, and how many trials, that the search for a start sees:
        chaos comes late.
    tried, finalists : sets of effects of one size that are refitted to beginnings, and to all.
    seed : of the cut into folds, and of the starts.
    """

    base: int = 2
    library: int = 5
    refit: int = 2
    fold: int = 1
    rounds: int = 3
    pays: float = 0.05
    folds: int = 4
    early: float = 0.65
    some: int = 26
    tried: int = 5
    finalists: int = 2
    seed: int = 0


RULE = Rule()
"""The rule where nobody sets another one."""
