"""Figures in one style; no other package except the commands imports this one.

Each `draw_...` writes a `.png` file at `path`, over what is there; `about` is kept in it, as
`style.picture` says.
"""

from utank_hil.pictures.bench_curves import BenchBar, BenchCurve, draw_bench
from utank_hil.pictures.capsize_maps import draw_capsize_maps
from utank_hil.pictures.loops import draw_bode, draw_nyquist
from utank_hil.pictures.records import draw_phase, draw_time

__all__ = [
    "BenchBar",
    "BenchCurve",
    "draw_bench",
    "draw_bode",
    "draw_capsize_maps",
    "draw_nyquist",
    "draw_phase",
    "draw_time",
]
