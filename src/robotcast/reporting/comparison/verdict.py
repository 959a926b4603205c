"""What the comparison amounts to, in two sentences."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from robotcast.reporting.numbers import error, odds, share

_DOUBT = 0.05

State = Literal["missing", "within", "open"]


@dataclass(frozen=True)
class Verdict:
    """How the model does against noise.

    Attributes
    ----------
    state : "missing" when it errs by more than noise, "within" when it does not, "open" when
        the repeats are too few to tell.
    """

    state: State
    kicker: str
    headline: str
    evidence: str


def verdict(comparison: Mapping[str, Any]) -> Verdict:
    """Judge a comparison by its repeats."""
    words, floor = comparison["words"], comparison["noise_floor_percent"]
    unit = comparison["error_unit"].removeprefix("% ")
    headline = (
        f"The model misses a {words['sample']} by {error(comparison['waypoint_error_percent'])} "
        f"{unit} on average"
    )
    if floor is not None:
        headline += f"; noise alone makes {error(floor)}"
    state = _state(comparison)
    return Verdict(state, _KICKERS[state], f"{headline}.", _evidence(comparison, state))


_KICKERS: dict[State, str] = {
    "missing": "The model errs by more than noise",
    "within": "The model is as good as these repeats can show",
    "open": "The noise is not known well enough to judge the model",
}


def _state(comparison: Mapping[str, Any]) -> State:
    fit = comparison["lack_of_fit"]
    if fit is None or fit["smallest_p_value"] > _DOUBT:
        return "open"
    return "missing" if fit["p_value"] <= _DOUBT else "within"


def _evidence(comparison: Mapping[str, Any], state: State) -> str:
    fit, words = comparison["lack_of_fit"], comparison["words"]
    if fit is None:
        return (
            f"No action was repeated, so nobody knows how much of the error is noise. "
            f"Repeat a few {words['trials']}, each three times or more."
        )
    beyond = share(comparison["share_beyond_noise"])
    repeated = "repeated action" + ("s" if fit["groups"] != 1 else "")
    repeats = f"{comparison['repeats']['trials']} {words['trials']} of {fit['groups']} {repeated}"
    if state == "open":
        return f"{repeats} are too few for a test. Repeat more {words['trials']}."
    if state == "within":
        return (
            f"On {repeats}, the model errs no more than they differ among themselves "
            f"(p = {fit['p_value']:.2g})."
        )
    return (
        f"Judged by {repeats}, {beyond} of the squared error is not noise. "
        f"By chance alone this would be seen {odds(fit['p_value'])} times."
    )
