"""A report as one self-contained HTML page of texts, tables and pictures."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from utank_hil.base.whole_file import write_whole
from utank_hil.pictures.style import DPI, TEXT_PT

LEAST_TEXT_PX: Final = 9.0  #: Readable on a screen.
TEXT_PX: Final = TEXT_PT / 72 * DPI  #: Size of a picture's text as drawn.
_TEMPLATE: Final = Path(__file__).with_name("report.html.jinja")


@dataclass(frozen=True, slots=True)
class ReportTable:
    """A table whose first column names the rows; `text` marks sentences instead of figures."""

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    text: bool = False


@dataclass(frozen=True, slots=True)
class ReportPicture:
    """A picture."""

    png: bytes  #: Content of the `.png` file.
    says: str  #: Description for readers who cannot see it.

    @property
    def base64(self) -> str:
        """Content of the picture in base64."""
        return base64.b64encode(self.png).decode()

    @property
    def least_px(self) -> int:
        """Width below which the text would be too small; a narrower screen scrolls sideways."""
        return round(int.from_bytes(self.png[16:20]) * LEAST_TEXT_PX / TEXT_PX)


@dataclass(frozen=True, slots=True)
class Verdict:
    """Result of a run, at the top of the page; `good` if nothing was wrong."""

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
    """Write the page over `path`, a `.html` file, and return the path.

    `about` is the line below the heading `title`; there is a verdict for each reported run. Raises
    `OSError` if the page cannot be written.
    """
    from jinja2 import Environment, StrictUndefined

    style: dict[str, Any] = {"autoescape": True, "trim_blocks": True, "lstrip_blocks": True}
    environment = Environment(undefined=StrictUndefined, **style)
    template = environment.from_string(_TEMPLATE.read_text(encoding="utf-8"))
    content = {"title": title, "about": about, "verdicts": verdicts, "sections": sections}
    write_whole(path, template.render(content))
    return path
