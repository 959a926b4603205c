"""A table of percentages, and its three written forms."""

import csv
import io
import re
from dataclasses import dataclass

_MISSING = "–"
_LATEX = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "_": r"\_",
    "#": r"\#",
    "π_RD": r"$\pi_\mathrm{RD}$",
    "π_SD": r"$\pi_\mathrm{SD}$",
    "π_R2S2R": r"$\pi_\mathrm{R2S2R}$",
    "D_real": r"$\mathcal{D}_\mathrm{real}$",
    "D_sim": r"$\mathcal{D}_\mathrm{sim}$",
    "Q1": "$Q_1$",
    "Q3": "$Q_3$",
    "∪": r"$\cup$",
    "×": r"$\times$",
    "π": r"$\pi$",
    "–": "--",
    "’": "'",
    "“": "``",
    "”": "''",
    "\u202f": r"\,",
    "\u00a0": "~",
}
_SYMBOLS = re.compile("|".join(map(re.escape, sorted(_LATEX, key=len, reverse=True))))


@dataclass(frozen=True)
class Cell:
    """One number in % of cable length, None when it was not run; the best is shown in bold."""

    value: float | None
    digits: int = 1
    best: bool = False

    @property
    def text(self) -> str:
        """The number as it is shown."""
        return _MISSING if self.value is None else f"{self.value:.{self.digits}f}%"


@dataclass(frozen=True)
class Group:
    """Neighbouring columns under one heading."""

    title: str
    columns: tuple[str, ...]


@dataclass(frozen=True)
class Row:
    """Labels, then one cell for every column of every group."""

    labels: tuple[str, ...]
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class Table:
    """A table with a caption, ready to be written.

    Attributes
    ----------
    name : stem of its files and its LaTeX label.
    reference : index of the first group that is not this run's own, for shading.
    """

    name: str
    caption: str
    label_columns: tuple[str, ...]
    groups: tuple[Group, ...]
    rows: tuple[Row, ...]
    reference: int

    def cells(self, row: Row) -> list[tuple[str, Cell]]:
        """Pair every cell of a row with its CSS classes."""
        kinds = [
            " ".join(["paper"] * (index >= self.reference) + ["first"] * (column == 0))
            for index, group in enumerate(self.groups)
            for column in range(len(group.columns))
        ]
        return list(zip(kinds, row.cells, strict=True))

    def markdown(self) -> str:
        """Write as a Markdown table; a column's heading names its group."""
        head = [*self.label_columns, *(f"{g.title}: {c}" for g in self.groups for c in g.columns)]
        rule = ["---"] * len(self.label_columns) + ["---:"] * (len(head) - len(self.label_columns))
        body = [
            [*row.labels, *(f"**{c.text}**" if c.best else c.text for c in row.cells)]
            for row in self.rows
        ]
        lines = ["| " + " | ".join(cells) + " |" for cells in (head, rule, *body)]
        return "\n".join([*lines, "", self.caption, ""])

    def csv(self) -> str:
        """Write plain numbers in % of cable length, empty where nothing was run."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        heads = [f"{g.title}: {c} [% of cable length]" for g in self.groups for c in g.columns]
        writer.writerow([*self.label_columns, *heads])
        for row in self.rows:
            numbers = ["" if c.value is None else f"{c.value:.{c.digits + 2}f}" for c in row.cells]
            writer.writerow([*row.labels, *numbers])
        return text.getvalue()

    def latex(self) -> str:
        """Write a table environment that shrinks to the text's width where it is wider.

        It needs \\usepackage{booktabs,graphicx}.
        """
        n_labels = len(self.label_columns)
        n_numbers = sum(len(g.columns) for g in self.groups)
        titles, rules, at = [], [], n_labels + 1
        for group in self.groups:
            width = len(group.columns)
            titles.append(rf"\multicolumn{{{width}}}{{c}}{{{to_latex(group.title)}}}")
            rules.append(rf"\cmidrule(lr){{{at}-{at + width - 1}}}")
            at += width
        columns = [*self.label_columns, *(c for g in self.groups for c in g.columns)]
        body = [
            [*map(to_latex, row.labels), *(_latex_cell(c) for c in row.cells)] for row in self.rows
        ]
        lines = [
            "% needs \\usepackage{booktabs,graphicx}",
            r"\begin{table*}[t]",
            r"  \centering\footnotesize\setlength\tabcolsep{4pt}",
            r"  \resizebox{\ifdim\width>\textwidth\textwidth\else\width\fi}{!}{%",
            rf"  \begin{{tabular}}{{@{{}}{'l' * n_labels}{'r' * n_numbers}@{{}}}}",
            r"  \toprule",
            "  " + " & " * n_labels + " & ".join(titles) + r" \\",
            "  " + " ".join(rules),
            "  " + " & ".join(map(to_latex, columns)) + r" \\",
            r"  \midrule",
            *("  " + " & ".join(cells) + r" \\" for cells in body),
            r"  \bottomrule",
            r"  \end{tabular}}",
            rf"  \caption{{{to_latex(self.caption)}}}",
            rf"  \label{{tab:{self.name}}}",
            r"\end{table*}",
            "",
        ]
        return "\n".join(lines)


def to_latex(text: str) -> str:
    """Return `text` with the symbols used in tables written in LaTeX."""
    return _SYMBOLS.sub(lambda found: _LATEX[found[0]], text)


def _latex_cell(cell: Cell) -> str:
    text = to_latex(cell.text)
    return rf"\textbf{{{text}}}" if cell.best else text
