"""Every number that decides stands in one documented place."""

import ast
import inspect
import re
from dataclasses import fields
from itertools import pairwise
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate

import robotcast.diagnosis
from robotcast.diagnosis.rule import RULE, Effort, Rule, Slicing

ROOT = Path(__file__).resolve().parents[2]
ROOM = Path(robotcast.diagnosis.__file__).parent
MODULES = sorted(p for p in ROOM.rglob("*.py") if p.name != "rule.py")
# How finely something is drawn, looked at or computed: more of it changes how sure a number is,
# not what it is held against.
EFFORTS = {
    "ALL_OVER", "CHOSEN", "DIGITS", "EARLY_ITERATIONS", "EDGE", "EXPECTED", "FEW",
    "FEWEST_FOR_A_TREND", "FEW_VALUES", "ITERATIONS", "LEAST_PART", "LOOKED_INTO",
    "MEMBERS", "MOST_RIVALS", "MOST_TIMES", "MOST_WEAK", "NOTHING", "PERMUTATIONS",
    "QUANTILES", "SEED", "SPREAD", "STEPPING", "UPDATES", "WINDOW_PART",
}  # fmt: skip
PLAIN = {0, 1, 2, 3, -1, 0.5, 1e-9}  # what formulas, shapes and rounding are made of


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(ROOM)))
def test_no_threshold_stands_elsewhere(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in tree.body:
        if isinstance(node, ast.Assign) and any(_numbers(node.value)):
            names = [n.id for t in node.targets for n in ast.walk(t) if isinstance(n, ast.Name)]
            assert set(names) <= EFFORTS, f"{path.name}: {names} belongs to rule.py"
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            odd = [n for side in (node.left, *node.comparators) for n in _numbers(side)]
            assert set(odd) <= PLAIN, f"{path.name}:{node.lineno}: {odd} belongs to rule.py"


def _numbers(node: ast.expr) -> list[float]:
    return [
        n.value
        for n in ast.walk(node)
        if isinstance(n, ast.Constant)
        and isinstance(n.value, int | float)
        and not isinstance(n.value, bool)
    ]


@pytest.mark.parametrize("kind", [Rule, Effort, Slicing])
def test_every_number_is_documented(kind: type) -> None:
    """By a comment behind it, on the line above, or above its run of fields, which names it."""
    lines = [line.strip() for line in inspect.getsource(kind).splitlines()]
    numbers, above = {one.name for one in fields(kind)}, ""
    for before, line in pairwise(lines):
        name, own = line.partition(":")[0], "#" in line
        if own:  # a run of fields ends where one has a comment of its own
            above = f"{above} {line}" if before.startswith("#") else line
        if name in numbers:
            numbers.remove(name)
            assert own or before.startswith("#") or re.search(rf"\b{name}\b", above), name
    assert not numbers


def test_the_configuration_sets_the_rule_and_the_page_states_it() -> None:
    with initialize_config_dir(str(ROOT / "conf"), version_base=None):
        config = compose("config", overrides=["diagnosis.rule.material=0.5"])
        plain = compose("config")
    assert instantiate(config.diagnosis.rule).material == 0.5
    assert instantiate(plain.diagnosis.rule) == RULE
    assert {f.name for f in fields(Rule)} <= {*plain.diagnosis.rule}
    page = (ROOT / "docs" / "decision.md").read_text(encoding="utf-8")
    said = (f"{100 * RULE.material:.0f} %", f"{RULE.at_floor} times", f"{100 * RULE.level:.0f} %")
    assert all(number in page for number in said)
