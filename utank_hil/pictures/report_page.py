"""A report as one HTML page that needs nothing else: texts, tables and pictures in it."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from utank_hil.base.whole_file import write_whole
from utank_hil.pictures.style import DPI, TEXT_PT

LEAST_TEXT_PX: Final = 9.0
TEXT_PX: Final = TEXT_PT / 72 * DPI
"""Of a picture's words as it was drawn."""
_TEMPLATE: Final = Path(__file__).with_name("report.html.jinja")


@dataclass(frozen=True, slots=True)
class ReportTable:
    """A table: the first column names the rows.

    Attributes
    ----------
    text : bool
        Whether the cells are sentences and not figures.
    """

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    text: bool = False


@dataclass(frozen=True, slots=True)
class ReportPicture:
    """A picture.

    Attributes
    ----------
    png : bytes
        Content of the `.png` file.
    says : str
        What it shows, for who can't see it.
    """

    png: bytes
    says: str

    @property
    def base64(self) -> str:
        """The content as the page holds it."""
        return base64.b64encode(self.png).decode()

    @property
    def least_px(self) -> int:
        """Width below which its words would be too small: a narrow screen scrolls sideways."""
        return round(int.from_bytes(self.png[16:20]) * LEAST_TEXT_PX / TEXT_PX)


@dataclass(frozen=True, slots=True)
class Verdict:
    """What is said first of all.

    Attributes
    ----------
    good : bool
        Whether nothing was wrong.
    """

    lines: Sequence[str]
    good: bool


@dataclass(frozen=True, slots=True)
class ReportSection:
    """A section of a report; `listings` are long texts by name, folded."""

    title: str
    texts: Sequence[str] = ()
    pictures: Sequence[ReportPicture] = ()
    tables: Sequence[ReportTable] = ()
    listings: Mapping[str, str] = field(default_factory=dict)


def write_report_page(
    path: Path,
    title: str,
    about: str,
    verdicts: Sequence[Verdict],
    sections: Sequence[ReportSection],
) -> Path:
    """Write the page; return its path.

    Parameters
    ----------
    path : Path
        The `.html` file; overwritten.
    title, about : str
        Heading, and the line below it.
    verdicts : sequence of Verdict
        Of each run that is reported.

    Raises
    ------
    OSError
        If the page can't be written.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    page = environment.from_string(_TEMPLATE.read_text(encoding="utf-8")).render(
        title=title, about=about, verdicts=verdicts, sections=sections
    )
    write_whole(path, page)
    return path
