"""Logs of a CAN bus in the formats of other programs."""
