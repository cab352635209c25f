"""Keeps the linear-algebra library to one thread; imported before anything that loads numpy.

The matrices here are small: more threads only get in each other's way (a robustness check took ten
times as long on a busy machine), and the loop process should have no threads but its own.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
