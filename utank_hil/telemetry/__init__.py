"""Telemetry: a shared-memory ring out of the loop, Rerun recordings and a live view."""
