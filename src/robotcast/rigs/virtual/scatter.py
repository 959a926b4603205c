"""How the start of a cast scatters from reset to reset."""

import hashlib
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
import polars as pl


@dataclass(frozen=True)
class StartScatter:
    """Headings of the cable after resets, as many were simulated (`measure_reset`).

    Attributes
    ----------
    places : ndarray of shape (p,), along the cable from 0 at the hand to 1 at the free end.
    headings_rad : ndarray of shape (resets, p), direction of the cable there; 0 is along +x.
    """

    places: np.ndarray
    headings_rad: np.ndarray

    def mean(self, segments: int) -> np.ndarray:
        """Return the mean headings of a chain's segments, (segments,) [rad]."""
        return self._along(self.headings_rad.mean(axis=0), segments)

    def draw(self, segments: int, random: np.random.Generator) -> np.ndarray:
        """Draw headings (segments,) [rad] with the mean and covariance of the resets."""
        mean = self.headings_rad.mean(axis=0)
        spread = (self.headings_rad - mean) / np.sqrt(len(self.headings_rad) - 1)
        drawn = mean + random.standard_normal(len(spread)) @ spread
        return self._along(drawn, segments)

    def digest(self) -> str:
        """Return a digest of the measured headings."""
        return hashlib.sha256(self.headings_rad.tobytes() + self.places.tobytes()).hexdigest()

    def _along(self, headings: np.ndarray, segments: int) -> np.ndarray:
        middles = (np.arange(segments) + 0.5) / segments
        return np.interp(middles, self.places, headings)


def read_scatter(path: Path) -> StartScatter:
    """Read a table of resets: one column a place (`heading_0.25`), one row a reset."""
    table = pl.read_csv(path)
    columns = [name for name in table.columns if name.startswith("heading_")]
    if len(columns) < 2 or len(table) < 3:
        raise ValueError(f"{path}: expected two or more heading_… columns and three or more resets")
    places = np.array([float(name.removeprefix("heading_")) for name in columns])
    return StartScatter(places, table.select(columns).to_numpy())


def scatter_table(scatter: StartScatter) -> pl.DataFrame:
    """Return the table that `read_scatter` reads."""
    columns = {
        f"heading_{place:g}": column
        for place, column in zip(scatter.places, scatter.headings_rad.T, strict=True)
    }
    return pl.DataFrame({"reset": np.arange(len(scatter.headings_rad)), **columns})


def straight_start() -> StartScatter:
    """Return a start without scatter, straight along +x."""
    return StartScatter(np.array([0.0, 1.0]), np.zeros((3, 2)))


def packaged_path(cable_name: str) -> Path:
    """Return where the committed table of a cable belongs."""
    folder = Path(str(resources.files("robotcast.rigs.virtual"))) / "scatter"
    return folder / f"{cable_name}.csv"


def packaged_scatter(cable_name: str) -> StartScatter:
    """Read the committed table of a cable of the virtual rig."""
    path = packaged_path(cable_name)
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in path.parent.glob("*.csv")))
        raise ValueError(
            f"virtual rig: no resets were measured for {cable_name} (known: {known}); "
            f"stages/measure_reset.py cable={cable_name} measures them"
        )
    return read_scatter(path)
