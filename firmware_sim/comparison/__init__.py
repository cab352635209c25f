"""Comparison of campaigns or recorded runs, with confidence intervals."""
