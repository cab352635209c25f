"""Adaptive fuzzy laws."""
