"""A ball that falls without air: the model that is diagnosed."""

from collections.abc import Callable, Sequence

import numpy as np
from candidates import G_M_S2, Balls, Mechanism

from robotcast.diagnosis.model import Record
from robotcast.fitting.parameter import Parameter


class FreeFall:
    """Predicts how far balls have fallen [m]; a `robotcast.diagnosis.model.Model`."""

    parameters = (Parameter("release_offset", "m", lower=-0.2, upper=0.2, nominal=0.0),)
    scale, error_unit = 1.0, "cm"  # errors are given in % of a metre

    def __init__(self, effects: Sequence[Mechanism]) -> None:
        self.effects = {effect.name: effect for effect in effects}

    def predict(
        self, records: Sequence[Record], active: Sequence[str], vectors: np.ndarray
    ) -> np.ndarray:
        """Return the distances fallen, (n_vectors, n_trials, k_max, 1), NaN past a trial's own."""
        value = iter(vectors.T[:, :, None])  # of each parameter, (n_vectors, 1)
        offset_m = next(value)
        effects = [self.effects[name] for name in active]
        acting = [(e, {p.name: next(value) for p in e.parameters}) for e in effects]
        balls = Balls.of(records)

        def acceleration(speed_m_s: np.ndarray) -> np.ndarray:
            further = (e.acceleration(speed_m_s, balls, **own) for e, own in acting)
            return sum(further, np.full_like(speed_m_s, G_M_S2))

        time_s = np.full((max(len(r.times_s) for r in records), 1, len(records)), np.nan)
        for ball, record in enumerate(records):
            time_s[: len(record.times_s), 0, ball] = record.times_s
        time_s = time_s + np.zeros_like(offset_m)  # (k_max, n_vectors, n_trials)
        for effect, own in acting:
            time_s = effect.happened(time_s, **own)
        fallen_m = fall(time_s, acceleration) + offset_m
        for effect, own in acting:
            fallen_m = effect.seen(fallen_m, **own)
        return np.moveaxis(fallen_m, 0, 2)[..., None]


def fall(time_s: np.ndarray, acceleration: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Integrate from rest at time 0: a Runge–Kutta step a sample (axis 0) errs by micrometres."""
    fallen_m, speed, now_s = (np.zeros(time_s.shape[1:]) for _ in range(3))
    path = []
    for then_s in np.maximum(time_s, 0.0):
        step_s = then_s - now_s
        k1 = acceleration(speed)
        k2 = acceleration(speed + step_s / 2 * k1)
        k3 = acceleration(speed + step_s / 2 * k2)
        k4 = acceleration(speed + step_s * k3)
        fallen_m = fallen_m + step_s * (speed + step_s / 6 * (k1 + k2 + k3))
        speed, now_s = speed + step_s / 6 * (k1 + 2 * k2 + 2 * k3 + k4), then_s
        path.append(fallen_m)
    return np.stack(path)
