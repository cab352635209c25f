"""Faults of processes and of a CAN interface, injected into the deployed programs."""
