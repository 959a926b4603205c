"""The command `robotcast STAGE [FOLDER] [OVERRIDE …]`, short for `python stages/STAGE.py …`.

A folder as the first word is a measurement set, or a robot's with its robot.yaml. It runs from the
repository that it was installed from in place (`pip install -e .`), because stages and
configuration lie there.
"""

import ast
import os
import runpy
import sys
from pathlib import Path

import hydra

from robotcast.build import CONFIGURATION

STAGES = CONFIGURATION.parent / "stages"
OF_A_SET = {  # stage → what a set stands for: setting → value
    "compare": {"measurements": "{set}", "output": "{outputs}/comparison"},
    "diagnose": {"measurements": "{set}", "output": "{outputs}/diagnosis"},
    "tune": {
        "paths.measurements": "{set}",
        "paths.diagnosis": "{outputs}/diagnosis",
        "paths.tuned": "{outputs}/${{simulator.name}}-${{optimizer.name}}",
    },
}
OF_A_ROBOT = {"model": "mjcf", "robot": "{set}", "output": "{outputs}/{stage}"}
HELP = ("-h", "--help")


def main() -> None:
    """Run the stage that the command line names; without one, list them."""
    if not (CONFIGURATION / "config.yaml").is_file():
        sys.exit(
            f"robotcast: {CONFIGURATION} holds no config.yaml: robotcast runs from its repository; "
            "install it there with pip install -e ."
        )
    name, *given = sys.argv[1:] or ["--help"]
    if name in ("-sc", "--shell-completion"):
        return _complete()
    if name in HELP:
        return print(_overview())
    script = STAGES / f"{name}.py"
    if script not in _scripts():
        names = ", ".join(path.stem for path in _scripts())
        sys.exit(f"robotcast: there is no {name}; there are {names}")
    if set(HELP) & set(given):
        print(_words(script), end="\n\n")
    sys.argv = [str(script), *overrides(name, given)]
    runpy.run_path(str(script), run_name="__main__")


def overrides(stage: str, given: list[str]) -> list[str]:
    """Return what the stage takes: a folder as the first word becomes settings, `given` win."""
    if stage not in (*OF_A_SET, "describe") or not given or not _is_folder(given[0]):
        return given
    folder, *given = given
    outputs = f"outputs/{Path(folder).resolve().name}"
    places = {"set": folder, "outputs": outputs, "stage": stage}
    known = {"robot": "{set}"} if stage == "describe" else OF_A_SET[stage]
    if stage in OF_A_SET and (Path(folder) / "robot.yaml").is_file():
        known = OF_A_ROBOT
    settings = {name: value.format(**places) for name, value in known.items()}
    quoted = {name: value.replace("'", r"\'") for name, value in settings.items()}
    return [*(f"{name}='{value}'" for name, value in quoted.items()), *given]


def _is_folder(word: str) -> bool:
    return Path(word).is_dir() or not ("=" in word or word.startswith(("-", "+", "~")))


def _scripts() -> list[Path]:
    return sorted(STAGES.glob("*.py"))


def _words(script: Path) -> str:
    return ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or ""


def _overview() -> str:
    lines = [f"  {path.stem:15}{_words(path).splitlines()[0]}\n" for path in _scripts()]
    return f"""robotcast STAGE [FOLDER] [OVERRIDE …]

{"".join(lines)}
FOLDER is a measurement set or a robot's, for {", ".join(OF_A_SET)}, describe; \
results go to outputs/NAME.
robotcast STAGE --help lists all that an OVERRIDE can set: simulator=hybrid seed=1
eval "$(robotcast -sc install=bash)" completes stages and settings (zsh, fish too)"""


def _complete() -> None:
    """Complete a stage's name; what follows it is completed by Hydra."""
    line = os.environ.get("COMP_LINE", "").split(" ", 1)[-1].lstrip()
    if sys.argv[-1].startswith("query="):
        stage, ended, rest = line.partition(" ")
        if not ended:
            return print(" ".join(p.stem for p in _scripts() if p.stem.startswith(stage)))
        first, _, others = rest.lstrip().partition(" ")
        if others and _is_folder(first):
            rest = others  # the folder before it is no setting
        os.environ["COMP_LINE"] = f"{stage} {rest}"
    of_config = hydra.main(version_base=None, config_path=str(CONFIGURATION), config_name="config")
    of_config(lambda config: None)()


if __name__ == "__main__":
    main()
