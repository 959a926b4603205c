"""How pages are written: one set of templates, which share a head, a style and filters."""

import base64
import re
import shlex
from collections.abc import Sequence
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup, escape

from robotcast.reporting import names

_HTML = {symbol: written for symbol, (_, written) in names.SYMBOLS.items()}
_LATEX = {
    **{symbol: written for symbol, (written, _) in names.SYMBOLS.items()},
    **{character: f"\\{character}" for character in "&%_#"},
    **{"\\": r"\textbackslash{}", "∪": r"$\cup$", "×": r"$\times$", "π": r"$\pi$"},
    **{"–": "--", "’": "'", "“": "``", "”": "''", "\u202f": r"\,", "\u00a0": "~"},
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


def to_latex(text: str) -> str:
    """Return `text` with the symbols used in tables written in LaTeX."""
    return names.replaced(text, _LATEX)


def markdown(columns: Sequence[str], rows: Sequence[Sequence[object]], labels: int = 99) -> str:
    """Return a table in Markdown; numbers get one decimal, and no zero a minus.

    The first `labels` columns stand on the left, the others on the right.
    """

    def text(cell: object) -> str:
        return f"{cell:z.1f}" if isinstance(cell, float) else str(cell)

    rule = ["---" if n < labels else "---:" for n in range(len(columns))]
    lines = [columns, rule, *([text(c) for c in row] for row in rows)]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


_TEMPLATES = Environment(
    loader=PackageLoader("robotcast.reporting", "template"),
    autoescape=select_autoescape(),
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
_WRITTEN = (
    "error", "number", "odds", "p_value", "quantity", "share", "thousands",
    "alternatives", "cable_name", "effect_name", "policy_label", "rig_name", "rig_names",
)  # fmt: skip
_TEMPLATES.globals.update({name: getattr(names, name) for name in _WRITTEN})
_TEMPLATES.filters.update({name: getattr(names, name) for name in _WRITTEN})
_TEMPLATES.globals["latex"] = _TEMPLATES.filters["latex"] = to_latex
_TEMPLATES.filters["symbols"] = lambda text: Markup(names.replaced(str(escape(text)), _HTML))
_TEMPLATES.filters["quote"] = shlex.quote
_TEMPLATES.filters["base64"] = lambda text: base64.b64encode(text.encode()).decode()
