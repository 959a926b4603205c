"""What every stage shares: its entry point, its bar, where its output goes."""

import os
import re
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import InstantiationException
from hydra.types import RunMode
from omegaconf import DictConfig
from polars.exceptions import PolarsError
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text
from threadpoolctl import threadpool_limits
from yaml import YAMLError

from robotcast import running
from robotcast.build import CONFIGURATION
from robotcast.measurements.measurement_set import MeasurementSet
from robotcast.measurements.reader import read_measurement_set


class _StageConsole(Console):
    def __reduce__(self) -> str:
        return "console"  # a parallel sweep hands stages to processes that have their own


console = _StageConsole(stderr=True)
TELL_EVERY_S = 60.0  # how often a long stage says where it stands, where nobody sees its bar


def stage(body: Callable[[DictConfig], None]) -> Callable[[], None]:
    """Turn `body(config)` into a command: composed by Hydra, refusing bad input in one line.

    An interrupt ends it with one line too. A step of a study takes the configurations of its own
    folder, which rest on conf/config.yaml: `full`, or the one that `--config-name` names.
    """
    name, folder = "config", Path(body.__code__.co_filename).resolve().parent
    if folder.parent.name == "studies":
        name = "full"
        sys.argv[1:1] = ["--config-dir", str(folder)]

    @wraps(body)  # Hydra names the job after the file that `body` stands in
    def run(config: DictConfig) -> None:
        try:
            for key in (key for key in NAMES if key in config):
                config[key] = _names(config[key])
            job, folder = HydraConfig.get(), Path(config.paths.running)
            followed = running.followed(folder, job.job.name, job.overrides.task)
            with _one_order_of_sums(), followed:
                return body(config)
        except (ValueError, OSError, InstantiationException, PolarsError, YAMLError) as error:
            said, status = _sentence(error), 2
        except KeyboardInterrupt:
            said = "interrupted; the same command goes on from what was finished"
            status = 130  # as a shell has it: 128 and the number of SIGINT
        console.print(f"{Path(sys.argv[0]).stem}: {said}", style="bold red", markup=False)
        sys.exit(status)

    command = hydra.main(version_base=None, config_path=str(CONFIGURATION), config_name=name)(run)

    @wraps(body)
    def main() -> None:
        sweep = any(argument in ("-m", "--multirun") for argument in sys.argv)
        sys.argv[1:] = [as_typed(argument, sweep) for argument in sys.argv[1:]]
        command()

    return main


NAMES = ("effects", "exclude")
PATHS = ("measurements", "robot", "output", "tuned", "session", "rig.path", "collect.actions")


def as_typed(argument: str, sweep: bool = False) -> str:
    """Return a setting as Hydra must read it, so that a path may hold whatever a path may hold.

    `effects=board_tilt+air_drag` is a list of two, with commas too where nothing is swept.
    """
    key, equals, value = argument.partition("=")
    if key in NAMES and value and value[0] not in "['\"$" and not (sweep and "," in value):
        return f"{key}=[{value}]"
    path = key in PATHS or key.startswith("paths.") or key == "evaluate.targets"
    in_quotes = len(value) > 1 and value[0] in "'\"" and value[0] == value[-1]
    as_it_is = in_quotes or value in ("", "null") or "${" in value or (sweep and "," in value)
    if as_it_is or not (equals and path):
        return argument
    quoted = re.sub(r"(\\+)(?=$|')", r"\1\1", value).replace("'", r"\'")
    return f"{key}='{quoted}'"


def _names(given: Any) -> list[str]:
    """Return names that were given as a list, or as words with + or commas between."""
    words = [given] if isinstance(given, str) else list(given or ())
    return [name for word in words for name in re.split(r"[,+\s]+", str(word)) if name]


def _sentence(error: Exception) -> str:
    """Return what went wrong in one line."""
    if isinstance(error, InstantiationException):
        cause = error.__cause__
        if isinstance(cause, ValueError | OSError):
            return _sentence(cause)
        return " ".join(str(cause or error).split())
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return " ".join(str(error).split())


@contextmanager
def _one_order_of_sums() -> Iterator[None]:
    """Keep linear algebra on one thread, here and in processes begun here.

    On several threads its sums end in other bits, which a search on a chaotic model turns into
    another answer. The matrices are too small to gain from more.
    """
    for library in ("OPENBLAS", "MKL"):
        os.environ[f"{library}_NUM_THREADS"] = "1"
    with threadpool_limits(limits=1, user_api="blas"):
        yield


def require(config: DictConfig, *names: str) -> None:
    """Refuse a call that names no folder for one of these settings."""
    for name in names:
        if config[name] is None:
            raise ValueError(f"{name}=DIR is needed")


def typed(group: str) -> list[str]:
    """Return what was overridden of a config group, for commands that must do the same."""
    overrides = HydraConfig.get().overrides.task
    return [o for o in overrides if o.startswith((f"{group}=", f"{group}."))]


def named_session(config: DictConfig) -> Path:
    """Return the folder of the configured session: `session=NAME` is one below paths.sessions."""
    folder = Path(config.paths.sessions)
    return folder if config.session is None else folder / str(config.session)


def output_folder(default: str, read: str | None = None) -> Path:
    """Return where to write: `default`, or the job's own folder in a Hydra multirun.

    Raises ValueError, before any work is done, where nothing can be written, or where it is the
    folder `read`, whose data are never changed.
    """
    hydra_config = HydraConfig.get()
    multirun = hydra_config.mode == RunMode.MULTIRUN
    folder = Path(hydra_config.runtime.output_dir if multirun else default)
    if read is not None and folder.resolve() == Path(read).resolve():
        raise ValueError(f"{folder}: is the folder that is read; name another to write to")
    there = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    if not there.is_dir():
        raise ValueError(f"{there}: is a file; name a folder to write to")
    try:
        os.rmdir(tempfile.mkdtemp(dir=there))
    except OSError as error:
        raise ValueError(f"{there}: cannot be written to ({error.strerror})") from None
    return folder


def unfinished_file(config: DictConfig, output: Path, suffix: str) -> Path:
    """Return where work whose result goes to `output` keeps its state until it is done.

    It lies beside DVC's outputs, which a rerun would delete.
    """
    names = [part for part in output.parts if part != output.anchor]
    return Path(config.paths.unfinished) / f"{'-'.join(names)}{suffix}"


def measured_set(folder: str) -> MeasurementSet:
    """Read the measurement set in `folder` and say what its user must know of it."""
    measured = read_measurement_set(Path(folder))
    for notice in measured.notices:
        warn(notice)
    return measured


def as_note(notice: str) -> str:
    """Return a notice as a sentence of a page."""
    return f"{notice[0].upper()}{notice[1:]}."


def tell(text: str) -> None:
    """Show a sentence as it stands."""
    console.print(text, markup=False)


def warn(text: str) -> None:
    """Show a sentence that should not be missed."""
    console.print(text, style="yellow", markup=False)


def confirm_ask(text: str) -> bool:
    """Ask the operator of a robot, who answers at a terminal."""
    if not sys.stdin.isatty():
        raise ValueError(
            "rig=ur5 asks an operator who stands beside the robot: run it in a terminal, or say "
            "rig.confirm=yes when somebody watches the arm"
        )
    tell(text)
    return console.input("Hand on the emergency stop? Type yes: ").strip().lower() == "yes"


def confirm_yes(text: str) -> bool:
    """Go on at once: somebody else watches the robot."""
    tell(text)
    return True


class _Rate(ProgressColumn):
    def render(self, task: Task) -> Text:
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:.1f}/s")


@contextmanager
def bar(title: str) -> Iterator[Callable[..., None]]:
    """Show a progress bar with a rate and what is left; yield its `progress(done, total, note)`.

    `robotcast watch` shows it too. Where the output is no terminal, a line a minute says it.
    """
    told_s = time.monotonic()
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        _Rate(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
        console=console,
    ) as shown:
        task = shown.add_task(title, total=None, note="")
        running.say(title=title, begun_s=time.time(), done=0, total=0, note="")

        def progress(done: int, total: int, note: str = "") -> None:
            nonlocal told_s
            # set past `update`, which forgets the rate whenever the total changes; 0 is not known
            shown.tasks[0].total = total or None
            shown.update(task, completed=done, note=note)
            running.say(now=done == total, done=done, total=total, note=note)
            if not console.is_terminal and time.monotonic() - told_s > TELL_EVERY_S:
                told_s = time.monotonic()
                tell(f"{title}: {done} of {total or '?'} {note}".rstrip())

        yield progress
