"""Pages of which only the tables between two marks are generated."""

import re
from collections.abc import Iterable
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"
PLACE = re.compile(
    r"(?<=; do not edit down to the end mark\. -->\n).*?(?=<!-- End of the generated table)", re.S
)


def written_anew(page: Path, lines: Iterable[str]) -> str:
    """The page as it stands, with these lines between its marks.

    Raises `ValueError` if the page does not have the marks once.
    """
    text, places = PLACE.subn(lambda _: "".join(lines), page.read_text(encoding="utf-8"))
    if places != 1:
        raise ValueError(
            f"{page}: generated tables must stand between their marks: {PLACE.pattern}"
        )
    return text
