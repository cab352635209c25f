"""Alarms and state for a ship's own systems, read-only, in the announcer's process."""
