"""Capsizing: thresholds, probability, phase-plane maps, and the effect of a law."""
