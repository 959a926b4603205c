"""How pages are made from templates: one environment, the family's style."""

from importlib.resources import files

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup


def environment() -> Environment:
    """Return a Jinja environment that escapes and refuses unknown names."""
    return Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )


def template(package: str, name: str) -> str:
    """Return the text of a file in a package's template folder."""
    return (files(package) / "template" / name).read_text("utf-8")


def style(*sheets: str) -> Markup:
    """Return the style that every page shares, then `sheets` of its own."""
    shared = (template("robotcast.reporting", name) for name in ("page.css", "head.css"))
    return Markup("\n".join([*shared, *sheets]))
