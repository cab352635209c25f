"""Colours as they are seen in grey, and by people who lack red or green cones."""

from itertools import product

import numpy as np
from matplotlib.colors import to_rgb

# full protanopia and deuteranopia, on linear RGB: Machado, Oliveira, Fernandes 2009, table 1
_LACKING = (
    [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
)
_XYZ = np.array(
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
)  # sRGB, D65
_GREY = _XYZ[1] * np.ones((3, 1))
LEAST_DIFFERENCE = 8.0
"""In CIE L*a*b*: two is just seen with the colours side by side, and a line is thin."""


def difference(one, other, *, grey):
    """How far apart two colours are to who lacks cones, the worse of both; or in grey."""
    return min(
        float(np.linalg.norm(_lab(one, seen) - _lab(other, seen)))
        for seen in ([_GREY] if grey else map(np.array, _LACKING))
    )


def alike(strokes, *, grey):
    """Pairs of strokes (colour, and what else it is told by) that are not told apart."""
    return [
        (i, j)
        for (i, (color, style)), (j, (other, other_style)) in product(enumerate(strokes), repeat=2)
        if i < j and style == other_style and difference(color, other, grey=grey) < LEAST_DIFFERENCE
    ]


def _lab(color, seen):
    """CIE L*a*b* of a colour after a change of its linear RGB."""
    rgb = np.array(to_rgb(color))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = _XYZ @ np.clip(seen @ linear, 0.0, 1.0) / _XYZ.sum(axis=1)
    root = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    x, y, z = root
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])
