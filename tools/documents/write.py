"""Write the generated documents; with --check, write nothing and fail if one is stale.

python -m tools.documents.write [--check]
"""

import argparse
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final

from tools.documents import catalogue, configuration, tables
from tools.documents.tables import DOCS, written_anew

TABLES: Final[dict[Path, Callable[[], Iterable[str]]]] = {
    DOCS / "safety.md": tables.faults,
    DOCS / "deployment.md": tables.exit_codes,
    DOCS / "how-to" / "outward.md": tables.registers,
}
WHOLE: Final = {catalogue.PAGE: catalogue.page, configuration.PAGE: configuration.page}


def main(arguments: list[str] | None = None) -> int:
    """Write each page, or compare with it."""
    parser = argparse.ArgumentParser(description="Write the generated documents.")
    parser.add_argument("--check", action="store_true", help="write nothing; fail if one is stale")
    check = parser.parse_args(arguments).check
    stale = False
    pages = {place: page() for place, page in WHOLE.items()}
    pages |= {place: written_anew(place, lines()) for place, lines in TABLES.items()}
    for place, text in pages.items():
        if place.exists() and place.read_text(encoding="utf-8") == text:
            continue
        if check:
            print(f"{place} is stale: run `make docs`", file=sys.stderr)
            stale = True
        else:
            place.write_text(text, encoding="utf-8")
    return int(stale)


if __name__ == "__main__":
    sys.exit(main())
