"""Faults of nodes, bus, pump and law, listed in a scenario or a campaign; see docs/faults.md."""
