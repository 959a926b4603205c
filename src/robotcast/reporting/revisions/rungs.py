"""Revisions of a model as rungs of a ladder."""

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from robotcast.reporting.ladder import Rung, ladder
from robotcast.reporting.names import effect_name, method_name
from robotcast.reporting.numbers import error
from robotcast.tuning.revisions import Revision

AXIS = "average waypoint error on held-out casts [% of cable length]"


@dataclass(frozen=True)
class Comparable:
    """Revisions that were tuned to the same casts and judged on the same others."""

    revisions: tuple[Revision, ...]

    @property
    def split(self) -> str:
        """The casts' fingerprint."""
        return self.revisions[0].split

    @property
    def best(self) -> Revision:
        """The revision with the smallest held-out error; of equals, the one with fewer effects."""
        return min(self.revisions, key=lambda r: (r.heldout_waypoint_error_percent, len(r.effects)))

    @property
    def methods(self) -> tuple[tuple[str, str], ...]:
        """The pairs of simulator and optimizer, in order."""
        return tuple(dict.fromkeys(map(_pair, self.revisions)))

    def base_of(self, revision: Revision) -> Revision | None:
        """Return the model without effects that another revision of its method adds to."""
        found = (r for r in self.revisions if not r.effects)
        return next((r for r in found if _pair(r) == _pair(revision)), None)

    @property
    def budgets_differ(self) -> bool:
        """Tell whether one revision was tuned with far more casts than another."""
        casts = [r.simulated_casts for r in self.revisions]
        return max(casts) > 1.2 * min(casts)

    def figure(self) -> Markup:
        """Draw the ladder."""
        rungs = [self._rung(revision) for revision in self.revisions]
        return ladder(rungs, self.revisions[0].noise_floor_percent, axis=AXIS)

    def _rung(self, revision: Revision) -> Rung:
        base = self.base_of(revision)
        above = base if base is not None and base is not revision else None
        final = f"final error {error(revision.heldout_final_error_percent)}"
        return Rung(
            label=revision_name(revision.effects),
            realised=revision.heldout_waypoint_error_percent,
            standard_error=revision.standard_error_percent,
            predicted=revision.predicted_waypoint_error_percent,
            detail=method_name(*_pair(revision)) if len(self.methods) > 1 else final,
            kind="model" if revision.effects else "base",
            compared_to=above.heldout_waypoint_error_percent if above else None,
        )


def comparable(revisions: Sequence[Revision]) -> tuple[Comparable, ...]:
    """Sort revisions by the casts they were judged on, most revisions first."""
    groups: dict[tuple[str, str], list[Revision]] = {}
    for revision in revisions:
        groups.setdefault((revision.cable, revision.split), []).append(revision)
    ordered = sorted(groups.items(), key=lambda item: (-len(item[1]), item[0]))
    return tuple(Comparable(tuple(group)) for _, group in ordered)


def revision_name(effects: Sequence[str]) -> str:
    """("air_drag", "board_tilt") → + air drag + board tilt."""
    return " ".join(f"+ {effect_name(e)}" for e in effects) or "base model"


def _pair(revision: Revision) -> tuple[str, str]:
    return revision.simulator, revision.optimizer
