"""The ledger of model revisions: one entry a revision, the same bytes in whatever order."""

import itertools
import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from robotcast.tuning.tuned import (
    LEDGER,
    comparable_revisions,
    keep_revision,
    read_revisions,
    record_revision,
)
from robotcast.workflow.tuning import promised_error
from tests.tuning.some_revisions import BASE, TILT

DRAG = replace(BASE, effects=("air_drag",), heldout_waypoint_error_percent=2.9)
BOTH = replace(BASE, effects=("air_drag", "board_tilt"), heldout_waypoint_error_percent=0.81)


def test_any_order_gives_the_same_bytes_and_is_read_base_first(tmp_path) -> None:
    ledgers = set()
    for number, order in enumerate(itertools.permutations((BASE, TILT, BOTH, DRAG))):
        path = tmp_path / str(number) / LEDGER
        for revision in order:
            record_revision(path, revision)
        ledgers.add(path.read_bytes())
        assert read_revisions(path) == (BASE, DRAG, TILT, BOTH)
    assert len(ledgers) == 1


def test_tuning_again_replaces_the_entry_and_touches_nothing_when_equal(tmp_path) -> None:
    path = tmp_path / LEDGER
    record_revision(path, BASE)
    record_revision(path, TILT)
    before = path.stat().st_mtime_ns
    record_revision(path, BASE)
    assert path.stat().st_mtime_ns == before
    better = replace(BASE, heldout_waypoint_error_percent=2.8)
    assert record_revision(path, better) == (better, TILT)


def test_tunings_side_by_side_lose_no_revision(tmp_path) -> None:
    path = tmp_path / LEDGER
    revisions = [replace(BASE, effects=(f"effect_{n:02d}",)) for n in range(12)]
    with ProcessPoolExecutor(4) as pool:
        list(pool.map(record_revision, itertools.repeat(path), revisions))
    assert list(read_revisions(path)) == revisions


def test_a_prediction_outlives_a_tuning_that_knows_of_none(tmp_path) -> None:
    record_revision(tmp_path / LEDGER, TILT)
    again = replace(TILT, heldout_waypoint_error_percent=1.1, predicted_waypoint_error_percent=None)
    kept = record_revision(tmp_path / LEDGER, again)
    assert kept[0].predicted_waypoint_error_percent == 1.31
    assert kept[0].heldout_waypoint_error_percent == 1.1


def test_only_revisions_on_the_casts_of_today_compare(tmp_path) -> None:
    keep_revision(tmp_path / "segmented-de", replace(BASE, split="old"))
    keep_revision(tmp_path / "segmented-de", BASE)
    keep_revision(tmp_path / "segmented-de", TILT)
    assert comparable_revisions(tmp_path) == (BASE, TILT)


def test_a_restored_folder_brings_its_revision_without_a_ledger(tmp_path) -> None:
    keep_revision(tmp_path / "segmented-de", TILT)
    (tmp_path / LEDGER).unlink()
    assert comparable_revisions(tmp_path) == (replace(TILT, predicted_waypoint_error_percent=None),)
    assert comparable_revisions(tmp_path / "nothing here") == ()


def test_a_broken_line_is_refused_by_name(tmp_path) -> None:
    (tmp_path / LEDGER).write_text('{"cable": "cable1"}\n')
    with pytest.raises(ValueError, match=r"revisions.jsonl line 1 is not a revision"):
        read_revisions(tmp_path / LEDGER)


def test_what_a_diagnosis_promised_is_found_by_its_effects(tmp_path) -> None:
    ladder = [
        {"effects": [], "heldout_waypoint_error_percent": 3.1},
        {"effects": ["board_tilt"], "heldout_waypoint_error_percent": 1.31},
        {"effects": ["board_tilt", "air_drag"], "heldout_waypoint_error_percent": 0.93},
    ]
    diagnosis = {"measurements": str(tmp_path), "ladder": ladder}
    (tmp_path / "diagnosis.json").write_text(json.dumps(diagnosis))

    def promised(*effects: str, measurements: Path = tmp_path) -> float | None:
        paths = {"diagnosis": str(tmp_path), "measurements": str(measurements)}
        return promised_error(OmegaConf.create({"effects": list(effects), "paths": paths}))

    assert promised("air_drag", "board_tilt") == 0.93
    assert promised() is None
    assert promised("camera_scale") is None
    assert promised("board_tilt", measurements=tmp_path / "another set") is None
