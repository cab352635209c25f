"""Figures in one style; no other package except the commands imports this one.

Each `draw_...` function overwrites a `.png` file at `path` and stores `about` in it (`picture`).
"""

from utank_hil.pictures.bench_curves import BenchBar as BenchBar
from utank_hil.pictures.bench_curves import BenchCurve as BenchCurve
from utank_hil.pictures.bench_curves import draw_bench as draw_bench
