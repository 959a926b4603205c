"""Making the configured effects: every file in conf/effect/ is one."""

from collections.abc import Sequence
from pathlib import Path

from hydra.utils import instantiate
from omegaconf import OmegaConf
from stage import CONFIGURATION

from robotcast.effects.effect import Effect


def known_effects() -> list[str]:
    """Return the names of all effects, those of the library and those a user added."""
    return sorted(path.stem for path in (Path(CONFIGURATION) / "effect").glob("*.yaml"))


def build_effects(names: Sequence[str]) -> tuple[Effect, ...]:
    """Make the named effects, in this order."""
    known = known_effects()
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError(
            f"effects: {', '.join(unknown)} has no file in conf/effect/; known: {', '.join(known)}"
        )
    return tuple(_build("effect", name) for name in names)


def build_fields() -> tuple[Effect, ...]:
    """Make every flexible field of conf/field/."""
    folder = Path(CONFIGURATION) / "field"
    return tuple(_build("field", path.stem) for path in sorted(folder.glob("*.yaml")))


def _build(group: str, name: str) -> Effect:
    config = OmegaConf.load(Path(CONFIGURATION) / group / f"{name}.yaml")
    return instantiate(config, name=name, _convert_="all")
