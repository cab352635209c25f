"""The closed loop: its margins, robustness, bounds, and what it is worth in a sea."""
