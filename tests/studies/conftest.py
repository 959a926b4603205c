from tests.rigs.conftest import rig

__all__ = ["rig"]
