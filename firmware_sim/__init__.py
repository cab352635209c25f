"""What stands in for the ship: sensor node, pump drive, ship emulator and operator panel."""

import utank_hil  # noqa: F401, first of all: it may have compiled modules loaded
