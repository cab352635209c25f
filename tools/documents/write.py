"""Write the generated documents; with --check, write nothing and fail if one is stale.

Usage: python -m tools.documents.write [--check]
"""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

from tools.documents import (
    catalogue,
    configuration,
    exit_codes,
    fault_campaign,
    faults,
    monitors,
    tables,
)


def pages() -> Iterator[tuple[Path, str]]:
    """Each generated document and what it should hold."""
    yield catalogue.PAGE, catalogue.page()
    yield faults.PAGE, faults.page()
    yield fault_campaign.PAGE, fault_campaign.page()
    yield monitors.PAGE, monitors.page()
    yield exit_codes.PAGE, exit_codes.page()
    yield configuration.PAGE, configuration.page()
    yield from tables.pages()


def main(arguments: list[str] | None = None) -> int:
    """Write each page, or compare with it."""
    parser = argparse.ArgumentParser(description="Write the generated documents.")
    parser.add_argument("--check", action="store_true", help="write nothing; fail if one is stale")
    check = parser.parse_args(arguments).check
    stale = False
    try:
        for place, text in pages():
            if place.exists() and place.read_text(encoding="utf-8") == text:
                continue
            if check:
                print(f"{place} is stale: run `make docs`", file=sys.stderr)
                stale = True
            else:
                place.write_text(text, encoding="utf-8")
    except tables.TableError as error:
        print(error, file=sys.stderr)
        return 1
    return int(stale)


if __name__ == "__main__":
    sys.exit(main())
