"""What things are called in front of people."""

from collections.abc import Iterable

_SIMULATORS = {"bullet": "PyBullet", "hybrid": "Hybrid", "segmented": "Segmented"}
_OPTIMIZERS = {"de": "DE", "bo": "BO", "gn": "Gauss–Newton"}
_DATASETS = {"real": "D_real", "simulated": "D_sim", "mixed": "D_real ∪ D_sim", "none": "N/A"}
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


def cable_name(cable: str) -> str:
    """cable1 → Cable 1."""
    number = cable.removeprefix("cable")
    return f"Cable {number}" if number.isdigit() else cable


def simulator_name(simulator: str) -> str:
    """segmented → Segmented."""
    return _SIMULATORS.get(simulator, simulator)


def optimizer_name(optimizer: str) -> str:
    """de → DE."""
    return _OPTIMIZERS.get(optimizer, optimizer)


def method_name(simulator: str, optimizer: str, effects: Iterable[str] = ()) -> str:
    """Return what was tuned by what: Segmented, DE + board tilt."""
    added = "".join(f" + {effect_name(effect)}" for effect in effects)
    return f"{simulator_name(simulator)}, {optimizer_name(optimizer)}{added}"


def dataset_name(dataset: str) -> str:
    """mixed → D_real ∪ D_sim."""
    return _DATASETS.get(dataset, dataset)


def policy_name(policy: str, dataset: str) -> str:
    """(nn, mixed) → π_R2S2R."""
    return _POLICIES.get((policy, dataset), policy)


def policy_label(policy: str, dataset: str) -> str:
    """Return the policy's name with its dataset where the name does not tell it."""
    name = policy_name(policy, dataset)
    return f"{name}, {dataset_name(dataset)}" if policy == "gp" else name


def rig_name(rig: str) -> str:
    """virtual → virtual rig, recorded → recorded set."""
    return {"virtual": "virtual rig", "recorded": "recorded set"}.get(rig, rig)


def rig_names(rigs: tuple[str, ...]) -> str:
    """Join the names of several rigs."""
    return " and ".join(rig_name(r) for r in rigs) or "no rig"


def thousands(number: float) -> str:
    """21450 → 21 450, with a narrow space that does not break."""
    return f"{number:,.0f}".replace(",", "\u202f")


def effect_name(effect: str) -> str:
    """board_tilt → board tilt."""
    return effect.replace("_", " ")


def factor_name(name: str) -> str:
    """theta1 → θ₁; a name without a symbol stays."""
    return _FACTORS.get(name, name.replace("_", " "))


def factor_label(name: str, unit: str) -> str:
    """theta1, rad → θ₁ [rad]."""
    return factor_name(name) if unit in ("", "1") else f"{factor_name(name)} [{unit}]"
