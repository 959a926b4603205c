"""The numbers that decide a diagnosis, and those that say how hard it tries."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Rule:
    """The decision, number by number: docs/decision.md says it, conf/diagnosis.yaml sets it.

    Attributes
    ----------
    level : chance of naming anything where nothing is missing, shared by all effects tried.
    equal : p-value above which two models explain the trials equally well.
    material : of the base model's typical error: what takes away less does not matter.
    at_floor : times what repeats differ by: up to there a model is as good as its data.
    most_effects : the most that are named together; more would explain anything.
    mostly : of what the base model misses beyond the floor: effects that take away less of it
        explain too little to be named where the rest stays above the floor.
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
    """

    level: float = 0.05
    equal: float = 0.05
    material: float = 0.2
    at_floor: float = 1.5
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


@dataclass(frozen=True)
class Effort:
    """How hard a diagnosis tries; no verdict hangs on these but through how well it fits.

    Attributes
    ----------
    base, library, refit, fold : iterations of the fits of the base model, of the whole library,
        of a few effects, and without a fold.
    folds : parts of the trials that are held out in turn.
    early, some : share of every trial, and how many trials, that the search for a start sees:
        chaos comes late.
    tried, finalists : sets of effects of one size that are refitted to beginnings, and to all.
    """

    base: int = 2
    library: int = 5
    refit: int = 2
    fold: int = 1
    folds: int = 4
    early: float = 0.65
    some: int = 26
    tried: int = 5
    finalists: int = 2
    seed: int = 0
