"""All figures of the source for the documents: their numbers as JSON, a few of their pictures.

    python -m tools.thesis.figures

Makes them as `utank-hil reproduce` does, prints the JSON object, and keeps the pictures that the
gallery page shows. Takes two minutes.
"""

import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from utank_hil.commands.reproduce import reproduce

PICTURES = Path(__file__).resolve().parents[2] / "docs" / "pictures" / "thesis"
SHOWN = ("2.7", "2.8", "3.2", "3.6", "3.9", "3.11", "capsize", "4.10")


def main() -> None:
    """Make all of them."""
    with TemporaryDirectory() as folder:
        reproduce(None, Path(folder), list_=False, json_=True)
        PICTURES.mkdir(exist_ok=True)
        for key in SHOWN:
            shutil.copy(Path(folder) / f"{key}.png", PICTURES)


if __name__ == "__main__":
    main()
