"""Hardware-in-the-loop controller stack for active U-tube anti-roll tanks."""
