"""Figures in one style: `draw_...` overwrites a `.png` file at `path` and stores `about` in it."""

from utank_hil.pictures.bench_curves import BenchBar as BenchBar
from utank_hil.pictures.bench_curves import BenchCurve as BenchCurve
from utank_hil.pictures.bench_curves import draw_bench as draw_bench
