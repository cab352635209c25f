"""Places of the shipped configurations and pages."""

from pathlib import Path
from typing import Final

_HERE: Final = Path(__file__).resolve()
_PLACES: Final = [_HERE.parents[2], *(up / "share" / "utank-hil" for up in _HERE.parents)]
# a checkout has both, an installation has them below its prefix, whichever that is
_SHARE: Final = next((place for place in _PLACES if (place / "configs").is_dir()), _PLACES[0])
CONFIGS: Final = _SHARE / "configs"
"""Folder of the shipped configurations."""
DOCS: Final = _SHARE / "docs"
"""Folder of the pages that messages point to."""
