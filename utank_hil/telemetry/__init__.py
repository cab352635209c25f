"""Telemetry: a shared-memory ring out of the loop, Rerun recordings and a live view.

`ring`, `event_ring` and `rotation` import little and may be used by the controller process.
"""
