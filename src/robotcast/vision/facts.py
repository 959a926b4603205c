"""What a session tells its tracker beforehand."""

from dataclasses import dataclass
from typing import Any

from robotcast.sessions import Session
from robotcast.vision.fiducials import FiducialBoard

BLOCK = "vision"


@dataclass(frozen=True)
class TrackingLimits:
    """When a film is not believed.

    Attributes
    ----------
    reprojection_px : root mean square distance of seen and explained marker corners, above which
        the markers do not lie where the session says; they are found to a third of a pixel.
    moved_px : how far the markers shift in the picture, above which the camera was moved.
    """

    reprojection_px: float = 1.5
    moved_px: float = 1.5


@dataclass(frozen=True)
class TrackerFacts:
    """The `vision` block of session.yaml: all that a person can measure or look up.

    Attributes
    ----------
    period_s : a waypoint is wanted every `period_s` from t = 0.
    exposure_s : exposure time; frame k is exposed from video_t0_s + k / fps on.
    focal_widths : the lens's nominal focal length in image widths.
    endpoint_radius_m, endpoint_height_m : the bright round end and how high its centre lies.
    endpoint_bgr, board_bgr : colours of the ball and the board, grey levels.
    """

    period_s: float
    exposure_s: float
    focal_widths: float
    endpoint_radius_m: float
    endpoint_height_m: float
    endpoint_bgr: tuple[float, float, float]
    board_bgr: tuple[float, float, float]
    fiducials: FiducialBoard

    @classmethod
    def of(cls, session: Session) -> "TrackerFacts":
        """Read what a session tells its tracker."""
        if BLOCK not in session.facts:
            raise ValueError(f"{session.folder}: session.yaml has no `{BLOCK}` block")
        return cls.from_dict(session.facts[BLOCK])

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> "TrackerFacts":
        """Read what `as_dict` wrote."""
        return cls(
            period_s=float(values["period_s"]),
            exposure_s=float(values["exposure_s"]),
            focal_widths=float(values["focal_widths"]),
            endpoint_radius_m=float(values["endpoint_radius_m"]),
            endpoint_height_m=float(values["endpoint_height_m"]),
            endpoint_bgr=_colour(values["endpoint_bgr"]),
            board_bgr=_colour(values["board_bgr"]),
            fiducials=FiducialBoard.from_dict(values["fiducials"]),
        )

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers for a YAML file."""
        return {
            "period_s": self.period_s,
            "exposure_s": self.exposure_s,
            "focal_widths": self.focal_widths,
            "endpoint_radius_m": self.endpoint_radius_m,
            "endpoint_height_m": self.endpoint_height_m,
            "endpoint_bgr": list(self.endpoint_bgr),
            "board_bgr": list(self.board_bgr),
            "fiducials": self.fiducials.as_dict(),
        }


def _colour(values: Any) -> tuple[float, float, float]:
    blue, green, red = (float(v) for v in values)
    return blue, green, red
