"""The numbers that decide a diagnosis, and those that say how hard it tries."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Slicing:
    """Which parts of the trials are said to hold most of the error; no verdict hangs on these."""

    level: float = 0.01  # chance that any part is named when the error depends on nothing
    most: int = 5  # parts named at most
    excess: float = 0.2  # of the squared error that must be more than repeats scatter
    beyond: float = 0.1  # a part's share of the error minus its share of the samples
    times: float = 1.3  # a part's share of the error over its share of the samples
    least: float = 0.05  # share of the samples that a part holds at least
    largest: float = 0.75  # share of the samples that a part holds at most
    fewest: int = 3  # trials that a part touches, and that tell what is usual
    # times what nine trials in ten stay below: a trial that is named alone
    outstanding: float = 3.0
    moving: float = 0.1  # of a trial's highest speed: slower, and it has no heading
    steady: float = 0.5  # of its root mean square, from which a mean error has a sign


SLICING = Slicing()


@dataclass(frozen=True)
class Rule:
    """The decision, number by number: docs/decision.md says it, conf/diagnosis.yaml sets it."""

    # chance of naming anything where nothing is missing, shared by all effects tried
    level: float = 0.05
    equal: float = 0.05  # p-value above which two models explain the trials equally well
    # of the base model's typical error, or of none's where that predicts better: what takes away
    # less does not matter
    material: float = 0.15
    # times what repeats differ by: up to there a model is as good as its data
    at_floor: float = 1.5
    # times what repeats differ by: above, something is missing whatever explains it. Below it may
    # be what two honest models of one thing differ by
    beyond: float = 3.0
    most_effects: int = 3  # the most that are named together; more would explain anything
    # of what a model misses beyond the floor: effects that take away less of it explain too little
    # to be named where the rest stays above the floor; a field that takes away more of what they
    # leave refutes them. Of what matters: a gain that is looked into further. And of what is missed
    # if nothing acts: what is left beside a base model that misses more
    mostly: float = 0.5
    fewest_groups: int = 8  # different trials below which nothing can be held back and tested
    # times the typical error: a trial of which even the best quarter is missed by more was measured
    # wrongly
    blunder: float = 10.0
    # p-value below which repeats that lie far apart in the session differ by more than those that
    # follow each other
    drift: float = 0.01
    close: float = 0.25  # of the session: repeats no farther apart follow each other
    least_noise: float = 0.003  # of the distance that the signal moves: less noise is not believed
    # chance of being noticed from which an effect that was not is called absent
    enough_power: float = 0.8
    faint: float = 0.02  # of the noise: an effect that moves every trial by less touches nothing
    # of an effect's sensitivity that the model's own parameters must not imitate
    distinct: float = 0.05
    # standard deviations beyond which a group's gain is drawn in before it is tested
    far: float = 4.0
    stray: float = 20.0  # times the repeats' usual deviation: so far away, a trial is no repeat
    # of what a model misses in a usual trial, that may be the same in all of them and shift its
    # parameters
    discrepancy: float = 0.5
    # squared noise by which two models must differ on the next trials together
    decides: float = 4.0
    at_bound: float = 0.005  # of a parameter's range: so near its end, a fit was pushed there
    ignored: float = 1e-4  # of the noise: a parameter whose range moves no trial by more is ignored


@dataclass(frozen=True)
class Effort:
    """How hard a diagnosis tries; no verdict hangs on these but through how well it fits."""

    base: int = 2  # iterations of the fit of the base model
    library: int = 5  # of that of the whole library
    refit: int = 2  # of those of a few effects
    fold: int = 1  # of those without a fold
    rounds: int = 3  # a refit to beginnings goes on so often
    pays: float = 0.05  # while that lowers its loss by this share
    folds: int = 4  # parts of the trials that are held out in turn
    early: float = 0.65  # share of every trial that the search for a start sees: chaos comes late
    some: int = 26  # how many trials it sees
    tried: int = 5  # sets of effects of one size that are refitted to beginnings
    finalists: int = 2  # sets of effects of one size that are refitted to all trials
    seed: int = 0  # of the cut into folds, and of the starts


RULE = Rule()
"""The rule where nobody sets another one."""
