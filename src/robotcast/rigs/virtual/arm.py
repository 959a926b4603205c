"""The arm of the virtual rig: how it lags, what chance does, and how resets leave the cable."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from robotcast.casts.tool_motion import ToolMotion


@dataclass(frozen=True)
class ArmDynamics:
    """A second-order lag with a gain error."""

    lag_s: float = 0.02  # by how much the tool follows late at constant speed
    damping: float = 0.9  # damping ratio
    gain_error: float = -0.004  # fraction by which the excursion from the start is too large

    def follow(self, planned: ToolMotion, t_s: np.ndarray, *, delay_s: float = 0.0) -> np.ndarray:
        """Return the pose (n, 3) of an arm that starts `delay_s` late, at evenly spaced `t_s`."""
        start = planned.pose[0]
        asked = start + (1 + self.gain_error) * (planned.at(t_s - delay_s) - start)
        # Bilinear transform of ω² / (s² + 2 ζ ω s + ω²), whose lag is 2 ζ / ω.
        k = 2 / (t_s[1] - t_s[0]) / (2 * self.damping / self.lag_s)
        middle = 2 * self.damping * k
        denominator = np.array([k * k + middle + 1, 2 - 2 * k * k, k * k - middle + 1])
        return lagged(np.array([1.0, 2.0, 1.0]), denominator, asked)


def lagged(numerator: np.ndarray, denominator: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Return what follows `asked` (n, k) in time, at rest before; coefficients of z⁰, z⁻¹ …"""
    from scipy.signal import lfilter, lfilter_zi  # half a second, for those who cast alone

    state = lfilter_zi(numerator, denominator)[:, None] * asked[0]
    return np.asarray(lfilter(numerator, denominator, asked, axis=0, zi=state)[0])


@dataclass(frozen=True)
class CastNoise:
    """Standard deviations of what changes from cast to cast."""

    friction: float = 0.015  # of the board's friction, relative
    tool_gain: float = 0.001  # of the arm's excursion, relative
    tool_delay_s: float = 0.002  # of the moment the arm starts
    tool_log_m: float = 0.0001  # of one logged tool sample
    tool_log_rad: float = 0.0005

    def draw(self, seed: int, number: int) -> tuple[float, float, float]:
        """Draw the friction's factor, the gain and the delay [s] of cast `number`."""
        friction, gain, delay = generator(seed, number, "cast").standard_normal(3).tolist()
        factor = float(np.exp(self.friction * friction))
        return factor, self.tool_gain * gain, abs(self.tool_delay_s * delay)


def generator(seed: int, number: int, purpose: str) -> np.random.Generator:
    """Return a generator that depends on the rig's seed, the cast's number and its use."""
    return np.random.default_rng(np.random.SeedSequence([seed, number, *purpose.encode()]))


@dataclass(frozen=True)
class StartScatter:
    """Headings of the cable after resets, as many were simulated (`rig.measure_resets`)."""

    places: np.ndarray  # (p,), along the cable from 0 at the hand to 1 at the free end
    headings_rad: np.ndarray  # (resets, p), direction of the cable there; 0 is along +x

    def mean(self, segments: int) -> np.ndarray:
        return self._along(self.headings_rad.mean(axis=0), segments)

    def draw(self, segments: int, random: np.random.Generator) -> np.ndarray:
        """Draw headings (segments,) [rad] with the mean and covariance of the resets."""
        mean = self.headings_rad.mean(axis=0)
        spread = (self.headings_rad - mean) / np.sqrt(len(self.headings_rad) - 1)
        return self._along(mean + random.standard_normal(len(spread)) @ spread, segments)

    def digest(self) -> str:
        return hashlib.sha256(self.headings_rad.tobytes() + self.places.tobytes()).hexdigest()

    def table(self) -> pl.DataFrame:
        """Return one column a place (`heading_0.25`), one row a reset."""
        names = [f"heading_{place:g}" for place in self.places]
        columns = dict(zip(names, self.headings_rad.T, strict=True))
        return pl.DataFrame({"reset": np.arange(len(self.headings_rad)), **columns})

    def _along(self, headings: np.ndarray, segments: int) -> np.ndarray:
        return np.interp((np.arange(segments) + 0.5) / segments, self.places, headings)


def packaged_path(cable_name: str) -> Path:
    return Path(__file__).parent / "scatter" / f"{cable_name}.csv"


def packaged_scatter(cable_name: str) -> StartScatter:
    path = packaged_path(cable_name)
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in path.parent.glob("*.csv")))
        raise ValueError(
            f"virtual rig: no resets were measured for {cable_name} (known: {known}); "
            f"stages/measure_reset.py cable={cable_name} measures them"
        )
    table = pl.read_csv(path)
    columns = [name for name in table.columns if name.startswith("heading_")]
    places = np.array([float(name.removeprefix("heading_")) for name in columns])
    return StartScatter(places, table.select(columns).to_numpy())
