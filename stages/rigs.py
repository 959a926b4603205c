"""Making the configured rig, for the stages that cast."""

from omegaconf import DictConfig
from virtual_rig import build_virtual_rig

from robotcast.rigs.rig import Rig


def build_rig(config: DictConfig) -> Rig:
    """Return the rig that `rig=` names; it must be one that can cast."""
    if config.rig.name == "ur5":
        from ur5_rig import build_ur5_rig

        return build_ur5_rig(config)
    if config.rig.name != "virtual":
        raise ValueError(f"rig={config.rig.name} cannot cast; the rigs that can: virtual, ur5")
    return build_virtual_rig(config)
