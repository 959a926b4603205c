"""Rigs that execute casts: the virtual one, a UR5, recorded sets; what an arm can do."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:  # the UR5's helper processes start without them
    from robotcast.casts.plan import PlannedCast
    from robotcast.measurements.measurement_set import Cable


class CastNotUsed(ValueError):
    """A cast was executed, but is not one to use; what was recorded is kept, and marked."""


class RigStopped(CastNotUsed):
    """The rig stopped in a cast: nothing moves until somebody looked after it."""


class Rig(Protocol):
    """An arm, a cable, a board and a camera that execute and film casts.

    `name` stands in tables. Up to `workers` casts may run side by side, each in a process of its
    own; more than one needs a rig that can be pickled.
    """

    @property
    def name(self) -> str: ...
    @property
    def cable(self) -> "Cable": ...
    @property
    def r0_m(self) -> float: ...
    @property
    def workers(self) -> int: ...

    def facts(self) -> dict[str, Any]:
        """Return what session.yaml holds for the tracker, as plain numbers, by block."""
        ...

    def cast(
        self, planned: "PlannedCast", number: int, folder: Path, *, rest_only: bool = False
    ) -> None:
        """Reset, execute and record one cast into the empty `folder`.

        Writes `video.mp4`, `tool.csv` (what the arm really did until the end rests) and
        `cast.yaml`. A virtual rig draws its chance from `number`; `rest_only` films only a few
        frames after the end came to rest. Raises ValueError with one sentence when the cast
        failed, `CastNotUsed` when what was recorded shall be kept aside, `RigStopped` when no
        further cast may follow.
        """
        ...
