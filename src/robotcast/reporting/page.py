"""How pages are written: one set of templates, which share a head, a style and filters."""

import base64
import re
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup, escape

from robotcast.reporting import names

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


def block(template: str, name: str, *given: Any, **named: Any) -> Any:
    """Return what a macro of a template writes: escaped Markup in HTML, plain text elsewhere."""
    return getattr(_TEMPLATES.get_template(template).module, name)(*given, **named)


def caption(name: str, *given: Any) -> str:
    """Return what stands below a table or figure, on one line."""
    return re.sub("[ \n]+", " ", block("captions.txt", name, *given)).strip()


def _symbols(text: str) -> Markup:
    return Markup(re.sub("|".join(_SYMBOLS), lambda found: _SYMBOLS[found[0]], str(escape(text))))


_TEMPLATES = Environment(
    loader=PackageLoader("robotcast.reporting", "template"),
    autoescape=select_autoescape(),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
_WRITTEN = (
    "error", "number", "odds", "p_value", "quantity", "share", "thousands",
    "cable_name", "effect_name", "policy_label", "rig_name", "rig_names",
)  # fmt: skip
_TEMPLATES.globals.update({name: getattr(names, name) for name in _WRITTEN})
_TEMPLATES.filters.update({name: getattr(names, name) for name in _WRITTEN})
_TEMPLATES.filters["symbols"] = _symbols
_TEMPLATES.filters["base64"] = lambda content: base64.b64encode(content).decode()
