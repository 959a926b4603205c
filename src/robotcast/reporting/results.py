"""Everything a report shows, read from the folders that the stages wrote; what is there is taken.

The expected layout under `data` is measurements/<cable>/, tuned/<cable>/<simulator>-<optimizer>/,
simulated/<cable>/, policies/<cable>/<policy>-<dataset>/ and
evaluation/<cable>/<policy>-<dataset>/.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np
import polars as pl
import yaml

from robotcast.measurements.errors import NoiseFloor, deviations, noise_floor
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.reader import read_measurement_set
from robotcast.policies.datasets import Examples, read_simulated
from robotcast.policies.targets import ErrorParts, error_parts, median_interval
from robotcast.reporting.names import cable_name, method_name, name_of, policy_name
from robotcast.tuning.tuned import ModelRevision, comparable_revisions

One = TypeVar("One")
_WITHIN_95 = -2 * np.log(0.05)  # of the squared distance in standard deviations, in the plane
_ROOMS = ("measurements", "tuned", "simulated", "policies", "evaluation")


@dataclass(frozen=True)
class Tuning:
    """One tuned simulator."""

    cable: str
    simulator: str
    optimizer: str
    facts: dict
    trace: pl.DataFrame | None  # simulated casts against the best error so far
    predictions: pl.DataFrame | None  # test casts measured and simulated; None without the file

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects that act in it, sorted."""
        return tuple(sorted(self.facts.get("effects", ())))

    @property
    def method(self) -> str:
        """What was tuned by what, with which effects, by name."""
        return method_name(self.simulator, self.optimizer, self.effects)

    @property
    def slug(self) -> str:
        """The same for the name of a file."""
        return "-".join((self.simulator, self.optimizer, *self.effects))

    def error(self, split: str, metric: str) -> float | None:
        """Return an error in % of cable length, None when that split was not judged."""
        return self.facts.get("errors", {}).get(split, {}).get(metric)

    @property
    def at_bounds(self) -> list[str]:
        """The parameters that the search left at a bound."""
        return [name for name, p in self.facts.get("parameters", {}).items() if p.get("at_bound")]

    @property
    def test_paths(self) -> pl.DataFrame | None:
        """Measured and simulated waypoints of the held-out casts whose run did not diverge."""
        if self.predictions is None:
            return None
        paths = self.predictions.filter(
            (pl.col("split") == "test") & pl.col("x_predicted").is_finite()
        )
        return None if paths.is_empty() else paths


@dataclass(frozen=True)
class Evaluation:
    """One policy's casts at its targets."""

    rig: str
    cable: str
    policy: str
    dataset: str
    kind: str  # "executed" on a rig, or "predicted" against recorded casts
    casts: pl.DataFrame  # one row a cast that was measured
    lost: int  # casts whose endpoint was not tracked
    targets: int  # how many were cast at, and how often each
    repeats: int
    unseen_m: tuple[tuple[float, float], ...] = ()  # targets where no endpoint was tracked

    @property
    def named(self) -> tuple[str, str, str]:
        """The cable, the policy and what it learned from, as people call them."""
        policy = policy_name(self.policy, self.dataset)
        return cable_name(self.cable), policy, name_of(self.dataset)

    @property
    def errors_percent(self) -> np.ndarray:
        """Errors (n,) in % of cable length."""
        return self.casts["error_percent"].to_numpy()

    @property
    def median_percent(self) -> float | None:
        """Median error in % of cable length; None without casts."""
        return float(np.median(self.errors_percent)) if len(self.casts) else None

    @property
    def scatter_percent(self) -> float | None:
        """Median distance of the repeats from their own mean, in % of cable length."""
        ends = [xy for _, _, xy in endpoints_by_target(self.casts)]
        away = [deviations(xy) for xy in ends if len(xy) > 1]
        if not away or self.kind != "executed":
            return None
        return float(np.median(np.concatenate(away))) * self._per_metre

    @property
    def parts(self) -> ErrorParts | None:
        """Repeatability and model in the error, in % of cable length; None without repeats."""
        if self.kind != "executed" or self.casts.is_empty():
            return None
        scale, by_target = self._per_metre, endpoints_by_target(self.casts)
        return error_parts(
            [xy * scale for _, _, xy in by_target], [t * scale for _, t, _ in by_target]
        )

    @property
    def expected_percent(self) -> float | None:
        """Median root mean square distance from its prediction that the model expects of a cast."""
        spread = self._each(pl.col("spread_x").pow(2) + pl.col("spread_y").pow(2))
        return None if spread is None else float(np.median(np.sqrt(spread))) * self._per_metre

    @property
    def within_expected(self) -> float | None:
        """Share of the casts that came to rest in the ellipse where the model expects 95 %."""
        x, y = (
            ((pl.col(k) - pl.col(f"predicted_{k}")) / pl.col(f"spread_{k}")).pow(2) for k in "xy"
        )
        away = self._each(x + y)
        return None if away is None else float((away <= _WITHIN_95).mean())

    def _each(self, expression: pl.Expr) -> np.ndarray | None:
        """Return a number of every cast; None where the model says nothing of its spread."""
        if self.casts.is_empty() or self.casts["spread_x"].is_null().any():
            return None
        return self.casts.select(expression).to_series().to_numpy()

    @property
    def median_interval(self) -> tuple[float, float] | None:
        """The 95 % interval of the median error, in % of cable length; None without casts."""
        return median_interval([*self.errors_by_target.values()]) if len(self.casts) else None

    @property
    def errors_by_target(self) -> dict[tuple[float, float], np.ndarray]:
        """Target (x, y) [m] → errors (repeats,) in % of cable length.

        Of recorded casts the prediction is judged, not where the cast ended; each is a target.
        """
        if self.kind == "executed":
            pairs = [(target, xy) for _, target, xy in endpoints_by_target(self.casts)]
        else:
            ends, targets = (
                self.casts.select(f"{of}_x", f"{of}_y").to_numpy() for of in ("predicted", "target")
            )
            pairs = list(zip(targets, ends[:, None], strict=True))
        return {
            (float(x), float(y)): np.linalg.norm(xy - (x, y), axis=1) * self._per_metre
            for (x, y), xy in pairs
        }

    @property
    def _per_metre(self) -> float:
        return float((self.casts["error_percent"] / self.casts["error_m"]).median())  # type: ignore


@dataclass(frozen=True)
class CableData:
    """What was measured and generated with one cable."""

    name: str
    measured: MeasurementSet | None
    floor: NoiseFloor | None
    tracking: dict  # the summary that track wrote, and what generate wrote, empty where unknown
    simulated: Examples | None
    generation: dict
    revisions: tuple[ModelRevision, ...] = ()  # models tuned so far that compare with today's


@dataclass(frozen=True)
class Results:
    """Everything under one data folder, ordered by cable and name."""

    cables: tuple[CableData, ...]
    tunings: tuple[Tuning, ...]
    evaluations: tuple[Evaluation, ...]
    policies: dict[tuple[str, str], dict] = field(default_factory=dict)

    @property
    def rigs(self) -> tuple[str, ...]:
        """The rigs that any of the results come from."""
        measured = {c.measured.rig for c in self.cables if c.measured}
        tuned = {t.facts.get("rig", "") for t in self.tunings}
        return tuple(sorted((measured | tuned | {e.rig for e in self.evaluations}) - {""}))

    def cable(self, name: str) -> CableData | None:
        """Return the data of one cable."""
        return next((c for c in self.cables if c.name == name), None)

    def evaluation(self, cable: str, policy: str, dataset: str) -> Evaluation | None:
        """Return one policy's evaluation."""
        wanted = (cable, policy, dataset)
        found = (e for e in self.evaluations if (e.cable, e.policy, e.dataset) == wanted)
        return next(found, None)

    def best_tuning(self, cable: str) -> Tuning | None:
        """Return the tuned simulator with the least average error on held-out casts of a cable."""
        return _least(
            (t.error("test", "waypoint_percent"), t) for t in self.tunings if t.cable == cable
        )

    def best_policy(self, cable: str) -> Evaluation | None:
        """Return the policy whose casts on a rig ended nearest to the targets, by the median."""
        of = [e for e in self.evaluations if e.cable == cable and e.kind == "executed"]
        return _least((e.median_percent, e) for e in of)


def _least(pairs: Iterable[tuple[float | None, One]]) -> One | None:
    known = [(number, one) for number, one in pairs if number is not None]
    return min(known, key=lambda pair: pair[0])[1] if known else None


def read_results(data: Path) -> Results:
    """Read every result under `data`."""
    names = sorted({p.name for room in _ROOMS for p in (data / room).glob("[!.]*") if p.is_dir()})
    if not names:
        raise ValueError(f"{data} holds no results to report: run the other stages first")
    cables = {folder: _read_cable(data, folder) for folder in names}
    return Results(
        cables=tuple(cables.values()),
        tunings=tuple(read_tuning(p) for p in sorted(data.glob("tuned/*/*/tuned.yaml"))),
        evaluations=tuple(
            read_evaluation(p) for p in sorted(data.glob("evaluation/*/*/evaluation.csv"))
        ),
        policies={
            (cables[p.parent.parent.name].name, p.parent.name): _read_yaml(p)
            for p in sorted(data.glob("policies/*/*/policy.yaml"))
        },
    )


def endpoints_by_target(casts: pl.DataFrame) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """Return (number, target (2,), endpoints (n, 2)) for every target, by number."""
    return [
        (
            int(group["target"][0]),
            group.select("target_x", "target_y").to_numpy()[0],
            group.select("x", "y").to_numpy(),
        )
        for _, group in casts.sort("target", "repeat").group_by("target", maintain_order=True)
    ]


def _read_cable(data: Path, name: str) -> CableData:
    """Read the folders called `name`; the cable is called what its measurements call it."""
    folder = data / "measurements" / name
    measured = read_measurement_set(folder) if folder.is_dir() else None
    casts = data / "simulated" / name / "casts.parquet"
    return CableData(
        name=measured.cable.name if measured else name,
        measured=measured,
        floor=noise_floor(measured) if measured else None,
        tracking=_read_yaml(folder / "tracking.json"),
        simulated=read_simulated(casts) if casts.exists() else None,
        generation=_read_yaml(casts.with_name("generation.yaml")),
        revisions=comparable_revisions(data / "tuned" / name),
    )


def read_tuning(path: Path) -> Tuning:
    """Read the folder of one tuned.yaml."""
    facts = _read_yaml(path)
    trace, predictions = path.with_name("trace.csv"), path.with_name("predictions.parquet")
    return Tuning(
        cable=facts["cable"]["name"],
        simulator=facts["simulator"],
        optimizer=facts["optimizer"],
        facts=facts,
        trace=pl.read_csv(trace) if trace.exists() else None,
        predictions=pl.read_parquet(predictions) if predictions.exists() else None,
    )


def read_evaluation(path: Path) -> Evaluation:
    """Read one evaluation.csv."""
    table = pl.read_csv(path, infer_schema_length=None)
    if table.is_empty():
        raise ValueError(f"{path} holds no casts: run the evaluate stage again")
    first = table.row(0, named=True)
    measured = table.drop_nulls("error_percent")
    unseen = table.join(measured, on="target", how="anti").unique("target", maintain_order=True)
    return Evaluation(
        **{name: first[name] for name in ("rig", "cable", "policy", "dataset", "kind")},
        casts=measured,
        lost=len(table) - len(measured),
        targets=table["target"].n_unique(),
        repeats=table["repeat"].n_unique(),
        unseen_m=tuple(unseen.select("target_x", "target_y").iter_rows()),
    )


def _read_yaml(path: Path) -> dict:
    return yaml.safe_load(path.read_text(encoding="utf-8")) or {} if path.exists() else {}
