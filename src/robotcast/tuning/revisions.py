"""Every revision of the model that was tuned on a cable's casts: the rungs of its error ladder.

A revision is written twice: to `revision.json` in the tuned folder, and to the ledger
`revisions.jsonl` beside the tuned folders, which remembers those that a later tuning has replaced.
The ledger is no output of a DVC stage, since DVC deletes outputs before a rerun and the cells of
one cable share it. The same revisions make the same bytes, whichever was tuned first.
"""

import fcntl
import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from robotcast.files import write_text
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.tuning.tuned import Tuned

LEDGER, REVISION = "revisions.jsonl", "revision.json"


@dataclass(frozen=True)
class ModelRevision:
    """One tuned model and how it did; errors are in % of cable length.

    Attributes
    ----------
    split : which casts it was tuned to and judged on; revisions compare only within one.
    effects : sorted ids, none for the base model.
    sizes : effect parameter → its tuned value and unit.
    standard_error_percent : of the held-out waypoint error.
    predicted_waypoint_error_percent : what a diagnosis promised before, if one did.
    """

    cable: str
    rig: str
    split: str
    tuning_casts: int
    heldout_casts: int
    simulator: str
    optimizer: str
    effects: tuple[str, ...]
    tuning_waypoint_error_percent: float
    heldout_waypoint_error_percent: float
    heldout_final_error_percent: float
    standard_error_percent: float | None
    noise_floor_percent: float | None
    simulated_casts: int
    sizes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    predicted_waypoint_error_percent: float | None = None

    @property
    def key(self) -> tuple[Any, ...]:
        """What makes it another revision, in the order in which revisions are listed."""
        model = (self.simulator, self.optimizer, len(self.effects), self.effects)
        return (self.cable, self.split, *model)


def revision_of(
    tuned: Tuned,
    tuning: MeasurementSet,
    heldout: MeasurementSet,
    noise_floor_percent: float | None,
    predicted_percent: float | None,
) -> ModelRevision:
    """Return the revision that a simulator is, tuned to one set and judged on another."""
    named = tuple(f"{effect}." for effect in tuned.effects)
    test = tuned.errors["test"]
    return ModelRevision(
        cable=tuned.cable.name,
        rig=tuned.rig,
        split=split_identity(tuning, heldout),
        tuning_casts=len(tuning.trials),
        heldout_casts=len(heldout.trials),
        simulator=tuned.simulator,
        optimizer=tuned.optimizer,
        effects=tuple(sorted(tuned.effects)),
        tuning_waypoint_error_percent=tuned.errors["tune"].waypoint_percent,
        heldout_waypoint_error_percent=test.waypoint_percent,
        heldout_final_error_percent=test.final_percent,
        standard_error_percent=test.standard_error_percent,
        noise_floor_percent=noise_floor_percent,
        simulated_casts=tuned.simulated_casts,
        sizes={
            p.name: {"value": float(tuned.values[p.name]), "unit": p.unit}
            for p in tuned.parameters
            if p.name.startswith(named)
        },
        predicted_waypoint_error_percent=predicted_percent,
    )


def split_identity(tuning: MeasurementSet, heldout: MeasurementSet) -> str:
    """Return a fingerprint of the casts on both sides of a split: their numbers and data."""
    digest = hashlib.sha256()
    for part in (tuning, heldout):
        digest.update(f"{part.cable}{part.r0_m}{[t.trial for t in part.trials]}".encode())
        for trial in part.trials:
            for array in (trial.tool.t_s, trial.tool.pose, trial.waypoints_s, trial.waypoints_m):
                digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:12]


def keep_revision(tuned_folder: Path, revision: ModelRevision) -> None:
    """Write a revision into its tuned folder and into the ledger beside it.

    The prediction goes into the ledger only: tuning did not find it.
    """
    own = replace(revision, predicted_waypoint_error_percent=None)
    text = json.dumps(asdict(own), indent=2, ensure_ascii=False)
    write_text(tuned_folder / REVISION, text + "\n")
    record_revision(tuned_folder.parent / LEDGER, revision)


def record_revision(path: Path, revision: ModelRevision) -> tuple[ModelRevision, ...]:
    """Put a revision into the ledger at `path`, in place of one of the same key; return all.

    Several may record at once: each reads and writes under a lock on the folder.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        revisions = _merged([*read_revisions(path), revision])
        text = "".join(json.dumps(asdict(r), ensure_ascii=False) + "\n" for r in revisions)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            write_text(path, text)
    finally:
        os.close(folder)  # which lets the lock go
    return revisions


def read_revisions(path: Path) -> tuple[ModelRevision, ...]:
    """Read a ledger; there are no revisions where there is no file."""
    if not path.exists():
        return ()
    lines = path.read_text(encoding="utf-8").splitlines()
    return _merged(_parsed(line, f"{path} line {n}") for n, line in enumerate(lines, start=1))


def comparable_revisions(folder: Path) -> tuple[ModelRevision, ...]:
    """Return all in a cable's ledger and tuned folders that share their casts with the latter.

    A folder that DVC restored without running anything brings its revision along.
    """
    tuned = sorted(folder.glob(f"*/{REVISION}"))
    now = [_parsed(path.read_text(encoding="utf-8"), str(path)) for path in tuned]
    splits = {revision.split for revision in now}
    ledger = read_revisions(folder / LEDGER)
    return _merged([*(r for r in ledger if r.split in splits), *now])


def _merged(revisions: Iterable[ModelRevision]) -> tuple[ModelRevision, ...]:
    """Keep the last revision of every key, in order; what was predicted is not forgotten."""
    kept: dict[tuple[Any, ...], ModelRevision] = {}
    for revision in revisions:
        before = kept.get(revision.key)
        if before is not None and revision.predicted_waypoint_error_percent is None:
            predicted = before.predicted_waypoint_error_percent
            revision = replace(revision, predicted_waypoint_error_percent=predicted)
        kept[revision.key] = revision
    return tuple(kept[key] for key in sorted(kept))


def _parsed(text: str, where: str) -> ModelRevision:
    try:
        plain = json.loads(text)
        known = {f.name: plain[f.name] for f in fields(ModelRevision)}
    except (json.JSONDecodeError, KeyError, TypeError) as error:
        raise ValueError(f"{where} is not a revision of a model ({error}); delete it") from error
    return ModelRevision(**{**known, "effects": tuple(known["effects"])})
