"""Every picture the package draws, in one style; nothing below imports this room."""

from utank_hil.pictures.bench_curves import BenchCurve, draw_bench
from utank_hil.pictures.capsize_maps import draw_capsize_maps
from utank_hil.pictures.loops import draw_bode, draw_nyquist
from utank_hil.pictures.records import draw_phase, draw_time

__all__ = [
    "BenchCurve",
    "draw_bench",
    "draw_bode",
    "draw_capsize_maps",
    "draw_nyquist",
    "draw_phase",
    "draw_time",
]
