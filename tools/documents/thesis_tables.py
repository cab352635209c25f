"""Tables of the source thesis."""

from typing import Any

from tools.documents.rows import Rows, Table, number
from tools.thesis.figure import Verdict, printed_text


def errata_terms(result: dict[str, Any]) -> Rows:
    """Every printed term that differs from first principles."""
    return [
        ["equation", "term", "printed coefficient", "first principles"],
        *([name, *(f"`{cell}`" for cell in cells)] for name, *cells in result["errata"]),
    ]


def thesis_figures(result: dict[str, Any]) -> Rows:
    """One row a figure of the source."""
    rows = [["figure", "", "greatest deviation", "holds", "in part", "does not", "open"]]
    for figure in result["figures"]:
        name = [figure["key"], figure["title"]]
        if figure["word"]:
            rows.append([*name, f"{figure['word']}: nothing to compute", "", "", "", ""])
            continue
        known = [row["deviation"] for row in figure["rows"] if row["deviation"] is not None]
        verdicts = [check["verdict"] for check in figure["checks"]]
        counts = (str(verdicts.count(verdict) or "") for verdict in Verdict)
        rows.append([*name, f"{max(known, key=abs):+.2%}" if known else "", *counts])
    return rows


def thesis_numbers(result: dict[str, Any]) -> Rows:
    """One row a printed number of the source."""
    return [
        ["figure", "number", "printed", "ours", "", "deviation", "reason"],
        *(
            [
                figure["key"],
                row["quantity"],
                printed_text(row),
                number(row["ours"], ".5g"),
                row["unit"],
                number(row["deviation"], "+.2%"),
                row["reason"],
            ]
            for figure in result["figures"]
            for row in figure.get("rows", ())
        ),
    ]


def thesis_statements(result: dict[str, Any]) -> Rows:
    """One row a statement of the source's text."""
    return [
        ["figure", "the text says", "", "measured"],
        *(
            [figure["key"], check["statement"], f"**{check['verdict']}**", check["measured"]]
            for figure in result["figures"]
            for check in figure.get("checks", ())
        ),
    ]


def thesis_contest(result: dict[str, Any]) -> Rows:
    """Who capsizes, a row a law and pump."""
    (table,) = (figure["table"] for figure in result["figures"] if figure["key"] == "contest")
    return [table["headings"], *table["rows"]]


TABLES: dict[str, Table] = {
    "errata terms": ("thesis_derivation", errata_terms),
    "thesis figures": ("thesis_figures", thesis_figures),
    "thesis numbers": ("thesis_figures", thesis_numbers),
    "thesis contest": ("thesis_figures", thesis_contest),
    "thesis statements": ("thesis_figures", thesis_statements),
}
