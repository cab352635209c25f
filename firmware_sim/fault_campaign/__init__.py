"""Fault campaign: each row of the fault table, in lockstep and on a bus; docs/faults.md."""
