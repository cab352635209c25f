"""Figures in one style; no other package except the commands imports this one.

Each `draw_...` writes a `.png` file at `path`, over what is there; `about` is kept in it, as
`style.picture` says.
"""

from utank_hil.pictures.bench_curves import BenchBar as BenchBar
from utank_hil.pictures.bench_curves import BenchCurve as BenchCurve
from utank_hil.pictures.bench_curves import draw_bench as draw_bench
