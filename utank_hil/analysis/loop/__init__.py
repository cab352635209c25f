"""Analysis of the closed loop: margins, robustness, and motion in a sea."""
