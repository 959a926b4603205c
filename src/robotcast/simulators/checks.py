"""What every simulator checks of its parameters and effects."""

from collections.abc import Sequence

from robotcast.effects.active import parameters_of
from robotcast.effects.effect import Effect
from robotcast.fitting.parameter import Parameter


def all_parameters(
    simulator: str,
    own: Sequence[str],
    parameters: Sequence[Parameter],
    effects: Sequence[Effect],
    tunes: Sequence[str] = (),
    lacks: Sequence[str] = (),
) -> tuple[Parameter, ...]:
    """Return a simulator's own parameters, which must be named `own`, then the effects'.

    `tunes` are the effects that are parameters of the simulator already, `lacks` the hooks through
    which no effect can act in it.
    """
    names = tuple(p.name for p in parameters)
    if names != tuple(own):
        raise ValueError(f"{simulator} simulator: expected parameters {tuple(own)}, got {names}")
    twice = [effect.name for effect in effects if effect.name in tunes]
    if twice:
        raise ValueError(f"{simulator} simulator: {', '.join(twice)} is a parameter of its own")
    deaf = [(e.name, hook) for e in effects for hook in lacks if e.acts_through(hook)]
    if deaf:
        said = ", ".join(f"{name} acts through {hook}" for name, hook in deaf)
        raise ValueError(f"{simulator} simulator: {said}, which it cannot carry")
    return (*parameters, *parameters_of(effects))
