"""How pages are written: one set of templates, which share a head, a style and filters."""

import base64
import re
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from robotcast.reporting.names import effect_name, thousands
from robotcast.reporting.numbers import error, number, odds, p_value, quantity, share

_SYMBOLS = {
    "π_R2S2R": "<i>π</i><sub>R2S2R</sub>",
    "π_RD": "<i>π</i><sub>RD</sub>",
    "π_SD": "<i>π</i><sub>SD</sub>",
    "D_real": "<i>D</i><sub>real</sub>",
    "D_sim": "<i>D</i><sub>sim</sub>",
    "Q1": "Q<sub>1</sub>",
    "Q3": "Q<sub>3</sub>",
}


def render(template: str, **given: Any) -> str:
    """Return a template filled in; what is given is escaped, and a name it lacks is refused."""
    return _TEMPLATES.get_template(template).render(**given)


def block(template: str, name: str, *given: Any, **named: Any) -> Markup:
    """Return a fragment of a page, written by a macro of a template."""
    return getattr(_TEMPLATES.get_template(template).module, name)(*given, **named)


def _symbols(text: str) -> Markup:
    return Markup(re.sub("|".join(_SYMBOLS), lambda found: _SYMBOLS[found[0]], str(escape(text))))


_TEMPLATES = Environment(
    loader=PackageLoader("robotcast.reporting", "template"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
_TEMPLATES.filters.update(
    base64=lambda content: base64.b64encode(content).decode(),
    symbols=_symbols,
    effect_name=effect_name,
    error=error,
    number=number,
    odds=odds,
    p_value=p_value,
    quantity=quantity,
    share=share,
    thousands=thousands,
)
