"""What stands in for the ship: sensor node, pump drive, ship emulator and operator panel."""
