from tests.reporting.conftest import data_folder
from tests.rigs.conftest import rig

__all__ = ["data_folder", "rig"]
