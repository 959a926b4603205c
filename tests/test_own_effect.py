"""An effect written after CONTRIBUTING.md lowers the error where the library fails."""

import re
import sys
from functools import partial
from types import ModuleType

import numpy as np
import pytest
from hydra.utils import instantiate
from omegaconf import OmegaConf

from robotcast.build import build_simulator
from robotcast.cast_model import CastModel, cast_records
from robotcast.diagnosis.diagnose import Case, floor_and_noise
from robotcast.diagnosis.inquiry import Inquiry
from robotcast.diagnosis.rule import Effort, Rule
from robotcast.diagnosis.selection import Selection
from robotcast.effects.effect import Effect
from robotcast.measurements.reader import read_measurement_set
from tests.stages import ROOT, configured

CASTING = ROOT.parent / "shared" / "data" / "casting" / "f"
NAME = "endpoint_pull"


@pytest.fixture
def own_effect(monkeypatch: pytest.MonkeyPatch) -> Effect:
    """The class and the entry of CONTRIBUTING.md."""
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    code = re.search(rf"```python\n# src/robotcast/effects/{NAME}\.py\n(.*?)```", page, re.S)
    text = re.search(r"```yaml\n# conf/effects\.yaml\n(.*?)```", page, re.S)
    assert code and text
    module = ModuleType(f"robotcast.effects.{NAME}")
    exec(code.group(1), module.__dict__)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    entry = OmegaConf.create(text.group(1)).effects[NAME]
    return instantiate(entry, name=NAME, _convert_="all")


@pytest.mark.slow
@pytest.mark.skipif(not CASTING.exists(), reason="needs ../shared/data/casting")
def test_the_guides_effect_explains_what_the_library_does_not_hold(own_effect: Effect) -> None:
    measured = read_measurement_set(CASTING)
    config = configured()
    simulator = partial(build_simulator, config, measured.cable)
    model = CastModel(measured, simulator, [own_effect], held=config.simulator.weighed)
    floor, noise = floor_and_noise(Case(model, cast_records(measured), [NAME]))
    inquiry = Inquiry(model, cast_records(measured), noise)
    effort, rule = Effort(), Rule()
    found = Selection(inquiry, [NAME], (), floor, rule, effort, lambda *told: None).run()
    assert found.named == (NAME,)
    before, after = (rung.errors.waypoint for rung in (found.base, found.top))
    assert floor.percent is not None
    assert np.median(after) < rule.at_floor * floor.percent
    assert after.mean() < 0.6 * before.mean()
