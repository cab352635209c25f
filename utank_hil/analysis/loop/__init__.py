"""The closed loop: its margins, robustness, and what it is worth in a sea."""
