"""Simulators from their numbers: parameters with bounds, some relative to a weighed mass."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from robotcast.effects.effect import Effect
from robotcast.fitting.parameter import Parameter
from robotcast.measurements.measurement_set import Cable
from robotcast.simulators.simulator import Simulator

Kind = Callable[[Cable, Sequence[Parameter], Any, Sequence[Effect]], Simulator]


def make_parameter(name: str, numbers: Mapping[str, Any], cable: Cable) -> Parameter:
    """Make a parameter from its config.

    Either `lower`, `upper` and `nominal`, or `weighed` and `spread`: the cable's attribute
    that is its nominal value, searched from nominal / spread to nominal · spread.
    """
    numbers = dict(numbers)
    if "weighed" in numbers:
        nominal, spread = float(getattr(cable, numbers.pop("weighed"))), numbers.pop("spread")
        if nominal <= 0:
            raise ValueError(f"parameter {name}: the cable's own value must be > 0, got {nominal}")
        numbers |= {"lower": nominal / spread, "upper": nominal * spread, "nominal": nominal}
    return Parameter(name=name, **numbers)


def make_simulator(
    kind: Kind,
    cable: Cable,
    parameters: Mapping[str, Mapping[str, Any]],
    settings: Any,
    effects: Sequence[Effect] = (),
) -> Simulator:
    """Make a simulator of `cable`, with these effects, from config numbers.

    Parameters
    ----------
    kind : makes it from cable, parameters, settings and effects: its class.
    parameters : name → numbers (see `make_parameter`).
    settings : of this kind, whatever they are.
    """
    made = [make_parameter(name, numbers, cable) for name, numbers in parameters.items()]
    return kind(cable, made, settings, effects)
