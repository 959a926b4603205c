"""Every configuration composes, and everything it names can be made."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hydra import compose, initialize_config_dir
from hydra.errors import MissingConfigException
from hydra.utils import get_object, instantiate
from omegaconf import DictConfig, OmegaConf

from robotcast.reporting.tables import TUNING
from tests.stages import ROOT, configured

CONF = ROOT / "conf"
LAUNCHERS = "hydra"  # of clusters: their libraries are extras
GROUPS = sorted(p.name for p in CONF.iterdir() if p.is_dir() and p.name != LAUNCHERS)
OPTIONS = sorted(
    f"{path.parent.relative_to(CONF)}={path.stem}"
    for group in GROUPS
    for path in (CONF / group).glob("**/*.yaml")
)
STUDIES = sorted(path for path in ROOT.glob("studies/*/*.yaml") if path.stem != "dvc")
LIBRARIES = OmegaConf.load(CONF / "effects.yaml")
ENTRIES = {**LIBRARIES.effects, **LIBRARIES.fields}


def targets(node: Any) -> Iterator[str]:
    children = node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()
    if isinstance(node, dict) and "_target_" in node:
        yield node["_target_"]
    for child in children:
        yield from targets(child)


@pytest.mark.parametrize("option", OPTIONS)
def test_every_option_composes_and_its_targets_exist(option: str) -> None:
    config = OmegaConf.to_container(configured(option), resolve=True)
    for target in targets(config):
        assert callable(get_object(target))


def study(path: Path) -> DictConfig:
    with initialize_config_dir(str(path.parent), version_base=None):
        return compose(path.stem, overrides=[f"hydra.searchpath=[{CONF}]"])


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_every_study_composes_and_its_targets_exist(path: Path) -> None:
    for target in targets(OmegaConf.to_container(study(path), resolve=True)):
        assert callable(get_object(target))


@pytest.mark.parametrize("name", ENTRIES)
def test_every_effect_and_field_can_be_made(name: str) -> None:
    made = instantiate(ENTRIES[name], name=name, _convert_="all")
    assert made.name == name
    assert all(p.probes for p in made.parameters)


@pytest.mark.parametrize("group", GROUPS)
def test_an_unknown_option_lists_the_known_ones(group: str) -> None:
    with pytest.raises(MissingConfigException) as refusal:
        configured(f"{group}=nonesuch")
    for path in (CONF / group).glob("*.yaml"):
        assert path.stem in str(refusal.value)


def sizes(config: DictConfig) -> dict[str, Any]:
    return {
        f"{stage}.{name}": size
        for stage, entries in config.scale.items()
        for name, size in entries.items()
    }


def test_scales_differ_in_sizes_only() -> None:
    """Only simulators that are not the paper's may be missing at some."""
    demo, paper = (sizes(configured(f"scale={scale}")) for scale in ("demo", "paper"))
    studied = sizes(study(ROOT / "studies/better_model/full.yaml"))
    own = {f"tune.{path.stem}" for path in (CONF / "simulator").glob("*.yaml")}
    own -= {f"tune.{name}" for name in TUNING}
    assert demo.keys() - own == paper.keys() - own == studied.keys() - own
    assert demo != paper
