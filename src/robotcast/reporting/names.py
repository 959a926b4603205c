"""What things are called, and how numbers are written, in front of people."""

import math
import re
from collections.abc import Iterable, Mapping

_NAMES = {
    **{"bullet": "PyBullet", "hybrid": "Hybrid", "segmented": "Segmented"},
    **{"de": "DE", "bo": "BO", "gn": "Gauss–Newton"},
    **{"real": "D_real", "simulated": "D_sim", "mixed": "D_real ∪ D_sim", "none": "N/A"},
}
_POLICIES = {
    ("cast_and_pull", "none"): "Cast and Pull",
    ("gp", "real"): "Gaussian Proc.",
    ("gp", "simulated"): "Gaussian Proc.",
    ("gp", "mixed"): "Gaussian Proc.",
    ("nn", "real"): "π_RD",
    ("nn", "simulated"): "π_SD",
    ("nn", "mixed"): "π_R2S2R",
    ("residual", "mixed"): "Residual",
}
_FACTORS = {"theta1": "θ₁", "theta2": "θ₂", "alpha": "α", "r1": "r₁", "r2": "r₂", "vmax": "v_max"}
# as LaTeX and matplotlib write the paper's symbols, and as a page does
SYMBOLS = {
    "π_R2S2R": (r"$\pi_\mathrm{R2S2R}$", "<i>π</i><sub>R2S2R</sub>"),
    "π_RD": (r"$\pi_\mathrm{RD}$", "<i>π</i><sub>RD</sub>"),
    "π_SD": (r"$\pi_\mathrm{SD}$", "<i>π</i><sub>SD</sub>"),
    "D_real": (r"$\mathcal{D}_\mathrm{real}$", "<i>D</i><sub>real</sub>"),
    "D_sim": (r"$\mathcal{D}_\mathrm{sim}$", "<i>D</i><sub>sim</sub>"),
    "Q1": ("$Q_1$", "Q<sub>1</sub>"),
    "Q3": ("$Q_3$", "Q<sub>3</sub>"),
}
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_MINUS, _THIN = "\u2212", "\u202f"
_SMALLEST_P = 1e-12  # below this a p-value says nothing more about data


def cable_name(cable: str) -> str:
    """cable1 → Cable 1."""
    number = cable.removeprefix("cable")
    return f"Cable {number}" if number.isdigit() else cable


def name_of(part: str) -> str:
    """Name a simulator, an optimizer or a dataset: segmented → Segmented, mixed → D_real …"""
    return _NAMES.get(part, part)


def method_name(simulator: str, optimizer: str, effects: Iterable[str] = ()) -> str:
    """Return what was tuned by what: Segmented, DE + board tilt."""
    added = "".join(f" + {effect_name(effect)}" for effect in effects)
    return f"{name_of(simulator)}, {name_of(optimizer)}{added}"


def policy_name(policy: str, dataset: str) -> str:
    """(nn, mixed) → π_R2S2R."""
    return _POLICIES.get((policy, dataset), policy)


def policy_label(policy: str, dataset: str) -> str:
    """Return the policy's name with its dataset where the name does not tell it."""
    name = policy_name(policy, dataset)
    return f"{name}, {name_of(dataset)}" if policy == "gp" else name


def rig_name(rig: str) -> str:
    """virtual → virtual rig, recorded → recorded set."""
    return {"virtual": "virtual rig", "recorded": "recorded set"}.get(rig, rig)


def rig_names(rigs: Iterable[str]) -> str:
    """Join the names of several rigs, each once; "" is none."""
    return " and ".join(rig_name(r) for r in sorted({*rigs} - {""})) or "no rig"


def thousands(number: float) -> str:
    """21450 → 21 450, with a narrow space that does not break."""
    return f"{number:,.0f}".replace(",", _THIN)


def effect_name(effect: str) -> str:
    """board_tilt → board tilt."""
    return effect.replace("_", " ")


def alternatives(sets: Iterable[Iterable[str]]) -> str:
    """[board_tilt, air_drag], [tool_lag] → board tilt and air drag or tool lag."""
    return " or ".join(" and ".join(map(effect_name, some)) for some in sets)


def factor_name(name: str) -> str:
    """theta1 → θ₁; a name without a symbol stays."""
    return _FACTORS.get(name, name.replace("_", " "))


def factor_label(name: str, unit: str) -> str:
    """theta1, rad → θ₁ [rad]."""
    return factor_name(name) if unit in ("", "1") else f"{factor_name(name)} [{unit}]"


def number(value: float | None, digits: int = 3) -> str:
    """Return `value` with `digits` significant digits; – when it is missing or not finite."""
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    power = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if -4 <= power < 5:
        text = f"{value:.{max(digits - 1 - power, 0)}f}"
    else:
        text = f"{value / 10.0**power:.{digits - 1}f}·10{str(power).translate(_RAISED)}"
    return text.replace("-", _MINUS)


def error(value: float | None, unit: str = "%") -> str:
    """Return an error with its unit: two decimals below 10, one above."""
    if value is None or not math.isfinite(value):
        return "–"
    text = f"{value:.1f}" if abs(value) >= 9.995 else f"{value:.2f}"
    return f"{text.replace('-', _MINUS)}{_THIN}{unit}"


def share(value: float | None) -> str:
    """Return a fraction as a whole percentage; what is not quite all or none stays so."""
    if value is None or not math.isfinite(value):
        return "–"
    if 0.995 <= value < 1:
        return f">{_THIN}99{_THIN}%"
    if 0 < value < 0.005:
        return f"<{_THIN}1{_THIN}%"
    return f"{100 * value:.0f}{_THIN}%"


def p_value(value: float | None) -> str:
    """Return a p-value with two significant digits; tiny ones as a power of ten."""
    if value is None or not math.isfinite(value):
        return "–"
    if value < _SMALLEST_P:
        return f"<{_THIN}10{'-12'.translate(_RAISED)}"
    return f"{value:.2g}" if value >= 0.001 else number(value, 2)


def odds(value: float) -> str:
    """Return a p-value as "1 in 2 000", for people who do not think in p-values."""
    if value > 0.4:
        return "1 in 2 or more"
    if value < 1e-6:
        return f"< 1 in {thousands(1e6)}"
    return f"1 in {thousands(float(f'{1 / value:.2g}'))}"


def quantity(value: float | None, unit: str, digits: int = 3) -> str:
    """Return a number with its unit; the unit 1 is not written."""
    return with_unit(number(value, digits), unit)


def with_unit(text: str, unit: str) -> str:
    """Return a written number with its unit; the unit 1 is not written, nor one after –."""
    return text if unit in ("", "1", "-", "–") or text == "–" else f"{text}{_THIN}{unit}"


def with_interval(value: float, low: float | None, high: float | None) -> tuple[str, str, str]:
    """Return a number and its interval with the decimals that the interval's width deserves."""
    if low is None or high is None or not high > low:
        return number(value), number(low), number(high)
    largest = max(abs(value), abs(low), abs(high))
    if largest < 1e-4 or largest >= 1e5:
        return number(value), number(low), number(high)
    decimals = max(1 - math.floor(math.log10((high - low) / 2)), 0)
    shown, least, most = (f"{v:.{decimals}f}".replace("-", _MINUS) for v in (value, low, high))
    return shown, least, most


def replaced(text: str, written: Mapping[str, str]) -> str:
    """Return `text` with every key of `written` as it says, the longest first."""
    keys = sorted(written, key=len, reverse=True)
    return re.sub("|".join(map(re.escape, keys)), lambda found: written[found[0]], text)


def math_text(text: str) -> str:
    """Return `text` with the paper's symbols as matplotlib writes them."""
    return replaced(text, {symbol: written for symbol, (written, _) in SYMBOLS.items()})
