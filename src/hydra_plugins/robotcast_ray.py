"""Hydra jobs on a Ray cluster that runs: `hydra/launcher=ray`."""

import os
from collections.abc import Sequence
from typing import Any

from hydra.core.singleton import Singleton
from hydra.core.utils import JobReturn
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig

from robotcast import ONE_PATH


class RayLauncher(Launcher):
    """Each job is a task of Ray; one whose machine went away runs again on another.

    The `address` of the cluster is as `ray.init` takes it; a job needs so many `cores`.
    """

    def __init__(self, address: str, cores: float) -> None:
        self.address, self.cores = address, cores

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        self.shared = hydra_context, config, task_function

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        # an extra, and slow to import, like the launcher whose jobs these are
        import ray  # pyright: ignore[reportMissingImports]
        from hydra_plugins.hydra_joblib_launcher._core import execute_job

        here, state = os.getcwd(), Singleton.get_state()

        def job(number: int, overrides: list[str]) -> Any:
            os.chdir(here)
            return execute_job(number, overrides, *self.shared, state)

        # a worker loads NumPy before it knows what the job imports
        ray.init(address=self.address, runtime_env={"env_vars": ONE_PATH})
        task = ray.remote(num_cpus=self.cores, max_retries=-1)(job)
        jobs = enumerate(job_overrides, initial_job_idx)
        return ray.get([task.remote(number, list(overrides)) for number, overrides in jobs])
