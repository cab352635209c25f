"""Write the generated documents; with --check, write nothing and fail if one is stale.

Usage: python -m tools.documents.write [--check]
"""

import argparse
import sys

from tools.documents import catalogue, faults


def main(arguments: list[str] | None = None) -> int:
    """Write each page, or compare with it."""
    parser = argparse.ArgumentParser(description="Write the generated documents.")
    parser.add_argument("--check", action="store_true", help="write nothing; fail if one is stale")
    check = parser.parse_args(arguments).check
    stale = 0
    for document in (catalogue, faults):
        text = document.page()
        if document.PAGE.exists() and document.PAGE.read_text(encoding="utf-8") == text:
            continue
        if check:
            print(f"{document.PAGE} is stale: run `make docs`", file=sys.stderr)
            stale += 1
        else:
            document.PAGE.write_text(text, encoding="utf-8")
    return min(stale, 1)


if __name__ == "__main__":
    sys.exit(main())
