"""Place of the shipped configurations."""

import sys
from pathlib import Path
from typing import Final

_CHECKOUT: Final = Path(__file__).resolve().parents[2] / "configs"
CONFIGS: Final = (
    _CHECKOUT if _CHECKOUT.is_dir() else Path(sys.prefix) / "share" / "utank-hil" / "configs"
)
"""Folder of the shipped configurations: in the checkout, or installed with the package."""
