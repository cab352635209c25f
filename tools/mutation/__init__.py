"""Mutation testing of the safety code: for each way to get it wrong, a test that fails.

`mutants.py` makes the mutants of a file, `session.py` runs the tests against them, `targets.py`
says which files and tests, and why some mutants are no different from the code.
"""

import os

# compiled modules have no code to exchange, and do not show what they hold
os.environ["UTANK_HIL_COMPILED"] = "0"
