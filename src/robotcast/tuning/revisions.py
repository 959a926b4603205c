"""Every revision of the model that was tuned on a cable's casts: the rungs of its error ladder.

A revision is written twice. `revision.json` in the tuned folder is a function of what tuning read
and goes where the folder goes. The ledger `revisions.jsonl` beside the tuned folders remembers
those that a later tuning has replaced. It is no output of any stage: DVC deletes outputs before a
rerun, the cells of one cable share it, and an output that persists would take the stage's other
outputs out of the run cache and hash differently after every history. Standing beside the outputs,
it is still part of what the report stage depends on. It bears no time and has one order, so the
same revisions make the same bytes, whichever was tuned first.
"""

import fcntl
import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from robotcast.files import write_text
from robotcast.measurements.errors import cast_errors
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.tuning.tuned import Tuned

LEDGER, REVISION = "revisions.jsonl", "revision.json"


@dataclass(frozen=True)
class Revision:
    """One tuned model and how it did; errors are in % of cable length.

    Attributes
    ----------
    split : tells which casts it was tuned to and judged on. Revisions compare only within one.
    effects : sorted ids, none for the base model.
    sizes : effect parameter → its tuned value and unit.
    standard_error_percent : of the held-out waypoint error, None of a single cast.
    predicted_waypoint_error_percent : what a diagnosis promised before, None if none did.
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
        data = (self.cable, self.split, self.simulator, self.optimizer)
        return (*data, len(self.effects), self.effects)


def revision_of(
    tuned: Tuned,
    tuning: MeasurementSet,
    heldout: MeasurementSet,
    heldout_m: np.ndarray,
    noise_floor_percent: float | None,
) -> Revision:
    """Return the revision that a tuned simulator is.

    Parameters
    ----------
    heldout_m : ndarray of shape (n_casts, k_max, 2), predicted waypoints of the held-out casts.
    """
    named = tuple(f"{effect}." for effect in tuned.effects)
    test = tuned.errors["test"]
    return Revision(
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
        standard_error_percent=_standard_error_percent(heldout, heldout_m),
        noise_floor_percent=noise_floor_percent,
        simulated_casts=tuned.simulated_casts,
        sizes={
            p.name: {"value": float(tuned.values[p.name]), "unit": p.unit}
            for p in tuned.parameters
            if p.name.startswith(named)
        },
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


def predicted_error(diagnosis: Mapping[str, Any], effects: Sequence[str]) -> float | None:
    """Return the held-out error in % that a diagnosis promised for a model with `effects`.

    That is what its own refit reached; None where no rung of its ladder has these effects.
    """
    for rung in diagnosis.get("ladder") or ():
        if effects and set(rung.get("effects") or ()) == set(effects):
            return rung.get("heldout_waypoint_error_percent")
    return None


def keep_revision(tuned_folder: Path, revision: Revision) -> tuple[Revision, ...]:
    """Write a revision into its tuned folder and into the ledger beside it; return the ledger.

    The prediction goes into the ledger only: tuning did not find it.
    """
    own = replace(revision, predicted_waypoint_error_percent=None)
    text = json.dumps(asdict(own), indent=2, ensure_ascii=False)
    write_text(tuned_folder / REVISION, text + "\n")
    return record_revision(tuned_folder.parent / LEDGER, revision)


def record_revision(path: Path, revision: Revision) -> tuple[Revision, ...]:
    """Put a revision into the ledger at `path`, in place of one of the same key.

    Several tunings may record at once: each reads and writes under a lock, in one step.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with _alone(path.parent):
        revisions = _merged([*read_revisions(path), revision])
        lines = [json.dumps(asdict(r), ensure_ascii=False) for r in revisions]
        text = "\n".join(lines) + "\n"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            write_text(path, text)
    return revisions


def read_revisions(path: Path) -> tuple[Revision, ...]:
    """Read a ledger; there are no revisions where there is no file."""
    if not path.exists():
        return ()
    lines = path.read_text(encoding="utf-8").splitlines()
    return _merged(_parsed(line, f"{path} line {n}") for n, line in enumerate(lines, start=1))


def tuned_revisions(folder: Path) -> tuple[Revision, ...]:
    """Return the revisions of the tuned simulators that lie in one cable's folder now."""
    return _merged(
        _parsed(path.read_text(encoding="utf-8"), str(path))
        for path in sorted(folder.glob(f"*/{REVISION}"))
    )


def comparable_revisions(folder: Path) -> tuple[Revision, ...]:
    """Return all that was ever tuned to and judged on the casts of the simulators tuned now.

    These are the revisions of one cable's ledger and of its tuned folders: one that DVC restored
    without running anything brings its revision along.
    """
    now = tuned_revisions(folder)
    splits = {revision.split for revision in now}
    ledger = read_revisions(folder / LEDGER)
    return _merged([*(r for r in ledger if r.split in splits), *now])


def _merged(revisions: Iterable[Revision]) -> tuple[Revision, ...]:
    """Keep the last revision of every key, in order; what was predicted is not forgotten."""
    kept: dict[tuple[Any, ...], Revision] = {}
    for revision in revisions:
        before = kept.get(revision.key)
        if before is not None and revision.predicted_waypoint_error_percent is None:
            predicted = before.predicted_waypoint_error_percent
            revision = replace(revision, predicted_waypoint_error_percent=predicted)
        kept[revision.key] = revision
    return tuple(kept[key] for key in sorted(kept))


def _parsed(text: str, where: str) -> Revision:
    try:
        plain = json.loads(text)
        known = {f.name: plain[f.name] for f in fields(Revision)}
    except (json.JSONDecodeError, KeyError, TypeError) as error:
        raise ValueError(f"{where} is not a revision of a model ({error}); delete it") from error
    return Revision(**{**known, "effects": tuple(known["effects"])})


def _standard_error_percent(heldout: MeasurementSet, heldout_m: np.ndarray) -> float | None:
    """Return the standard error of the average waypoint error; a diverged cast misses by L."""
    if len(heldout.trials) < 2:
        return None
    average_m, _ = cast_errors(heldout_m, heldout.trials)
    length_m = heldout.cable.length_m
    average_m = np.where(np.isnan(average_m), length_m, average_m)
    return float(100 / length_m * average_m.std(ddof=1) / np.sqrt(len(average_m)))


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Wait until no other process holds the folder's lock, and hold it."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
