"""Making what the configuration names by `_target_`, so that no stage knows which rig, simulator
or effects are configured, and depends on no other's code."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hydra.utils import get_object, instantiate
from omegaconf import Container, DictConfig, OmegaConf

from robotcast.files import digest

CONFIGURATION = Path(__file__).resolve().parents[2] / "conf"


def build(node: Any, **more: Any) -> Any:
    """Make a part of the configuration: lists become tuples, `_target_` is called with the rest.

    Unlike Hydra's `instantiate` this gives frozen classes nothing that can change.
    """
    plain = OmegaConf.to_container(node, resolve=True) if isinstance(node, Container) else node
    return _made({**plain, **more} if isinstance(plain, dict) else plain)


def _made(node: Any) -> Any:
    if isinstance(node, dict):
        parts = {key: _made(value) for key, value in node.items()}
        target = parts.pop("_target_", None)
        return parts if target is None else get_object(target)(**parts)
    return tuple(map(_made, node)) if isinstance(node, list) else node


def action_space(config: DictConfig, grid: str) -> tuple[Any, float, Any, Any]:
    """Return a grid (`collected`, `generated` or `candidates`), r₀ [m], plan limits and envelope.

    That is what `feasible_actions` takes.
    """
    casts = config.casts
    return build(casts.grids[grid]), casts.r0_m, build(casts.limits), build(casts.envelope)


def build_rig(config: DictConfig, **changes: Any) -> Any:
    """Return the rig that `rig=` names, or refuse one that cannot cast; nothing connects yet."""
    rig = config.rig
    if "build" not in rig:
        raise ValueError(f"rig={rig.name} cannot cast; the rigs that can: virtual, ur5")
    if "client" in rig and not rig.dry_run:
        for name, what in (("host", "the controller's address"), ("camera", "0 or /dev/video0")):
            if rig[name] is None:
                raise ValueError(f"rig={rig.name} needs rig.{name}=… ({what})")
        build(rig.client)
    return build(rig.build, **changes)


def with_cable(config: DictConfig, cable: str) -> DictConfig:
    """Return the configuration with another cable of conf/cable."""
    changed = config.copy()
    changed.cable = OmegaConf.load(CONFIGURATION / "cable" / f"{cable}.yaml")
    return changed


def build_simulator(config: DictConfig, cable: object, effects: Sequence[object] = ()) -> Any:
    """Return the configured simulator of a cable with these effects at work."""
    return instantiate(config.simulator.model, cable=cable, effects=list(effects))


def known_effects() -> list[str]:
    """Return the names of all effects, those of the library and those a user added."""
    return sorted(_library().effects)


def build_effects(names: Sequence[str]) -> tuple[Any, ...]:
    """Make the named effects, in this order."""
    known = _library().effects
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError(
            f"effects: {', '.join(unknown)} has no entry in conf/effects.yaml; "
            f"known: {', '.join(sorted(known))}"
        )
    return tuple(instantiate(known[name], name=name, _convert_="all") for name in names)


def build_fields() -> tuple[Any, ...]:
    """Make every flexible field."""
    fields = _library().fields
    return tuple(instantiate(fields[name], name=name, _convert_="all") for name in sorted(fields))


def _library() -> Any:
    return OmegaConf.load(CONFIGURATION / "effects.yaml")


def fingerprint(config: DictConfig, parts: dict[str, Any], *known: object) -> str:
    """Return a digest of parts of the configuration, resolved, and of whatever else is known."""
    text = OmegaConf.to_yaml(OmegaConf.create(parts, parent=config), resolve=True)
    return digest(text, *known)
