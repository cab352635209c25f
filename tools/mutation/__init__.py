"""Mutation testing of the safety code: for each way to get it wrong, a test that fails.

`run.py` is the command, `mutants.py` makes the mutants of a file, `session.py` runs the tests
against them, `targets.py` says which files and tests, and why some mutants are no different from
the code. `coverage.py` holds the branch coverage of the same files by the same tests.
"""
