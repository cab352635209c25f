"""Random and mutated input, seeded: frames at the nodes, texts at the reader of configurations."""

import os

# compiled modules have no code to exchange, and do not show what they hold
os.environ["UTANK_HIL_COMPILED"] = "0"
