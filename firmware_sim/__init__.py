"""Emulated ship side: sensor node, pump drive, ship, operator panel; benches and campaigns."""

import utank_hil  # noqa: F401, first of all: it may have compiled modules loaded
