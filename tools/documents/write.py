"""Write the generated documents; with --check, write nothing and fail if one is stale.

python -m tools.documents.write [--check]
"""

import argparse
import sys
from types import ModuleType
from typing import Final

from tools.documents import catalogue, configuration, exit_codes, faults, registers

GENERATED: Final[tuple[ModuleType, ...]] = (catalogue, faults, exit_codes, configuration, registers)
"""Each has a `PAGE` and, as `page()`, what it should hold."""


def main(arguments: list[str] | None = None) -> int:
    """Write each page, or compare with it."""
    parser = argparse.ArgumentParser(description="Write the generated documents.")
    parser.add_argument("--check", action="store_true", help="write nothing; fail if one is stale")
    check = parser.parse_args(arguments).check
    stale = False
    for each in GENERATED:
        place, text = each.PAGE, each.page()
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
