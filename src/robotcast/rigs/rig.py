"""What every rig offers, real or virtual."""

from pathlib import Path
from typing import Any, Protocol

from robotcast.casts.plan import PlannedCast
from robotcast.measurements.measurement_set import Cable


class CastNotUsed(ValueError):
    """A cast was executed, but is not one to use; what was recorded is kept, and marked."""


class RigStopped(CastNotUsed):
    """The rig stopped in a cast: nothing moves until somebody looked after it."""


class Rig(Protocol):
    """An arm, a cable, a board and a camera that execute and film casts.

    Attributes
    ----------
    name : how tables name the rig.
    workers : how many casts may run side by side, each in a process of its own; more than one
        needs a rig that can be pickled.
    """

    @property
    def name(self) -> str: ...

    @property
    def cable(self) -> Cable: ...

    @property
    def r0_m(self) -> float: ...

    @property
    def workers(self) -> int: ...

    def facts(self) -> dict[str, Any]:
        """Return what session.yaml tells the tracker, as plain numbers, by block."""
        ...

    def cast(
        self, planned: PlannedCast, number: int, folder: Path, *, rest_only: bool = False
    ) -> None:
        """Reset, execute and record one cast into the empty `folder`.

        Writes `video.mp4`, `tool.csv` (t, x, y, yaw of what the arm really did until the end
        rests) and `cast.yaml`. Raises ValueError with one sentence when the cast failed,
        `CastNotUsed` when what was recorded shall be kept aside, `RigStopped` when no further
        cast may follow.

        Parameters
        ----------
        number : of the cast in its session; a virtual rig draws its chance from it.
        rest_only : film only a few frames after the end came to rest.
        """
        ...
