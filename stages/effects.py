"""Making the effects and the flexible fields of conf/effects.yaml."""

from collections.abc import Sequence
from pathlib import Path

from hydra.utils import instantiate
from omegaconf import DictConfig, OmegaConf
from stage import CONFIGURATION

from robotcast.effects.effect import Effect


def known_effects() -> list[str]:
    """Return the names of all effects, those of the library and those a user added."""
    return sorted(_entries().effects)


def build_effects(names: Sequence[str]) -> tuple[Effect, ...]:
    """Make the named effects, in this order."""
    known = _entries().effects
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError(
            f"effects: {', '.join(unknown)} has no entry in conf/effects.yaml; "
            f"known: {', '.join(sorted(known))}"
        )
    return tuple(_build(known, name) for name in names)


def build_fields() -> tuple[Effect, ...]:
    """Make every flexible field."""
    fields = _entries().fields
    return tuple(_build(fields, name) for name in sorted(fields))


def _entries() -> DictConfig:
    config = OmegaConf.load(Path(CONFIGURATION) / "effects.yaml")
    assert isinstance(config, DictConfig)
    return config


def _build(entries: DictConfig, name: str) -> Effect:
    return instantiate(entries[name], name=name, _convert_="all")
