"""Capsizing: thresholds, probability, maps, and what a law changes."""
