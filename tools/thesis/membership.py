"""Figure 4.5: the fuzzy sets negative, zero and positive, as printed in (4.26) and as built."""

import math
from typing import Final

import numpy as np

from tools.thesis.figure import Check, Figure, Verdict, panel_of
from utank_hil.base.arrays import FloatArray
from utank_hil.control.fuzzy.law import WIDTH, FuzzyBasis

RANGE: Final = math.pi / 6
_NAMES: Final = ("negative", "zero", "positive")
_AXES: Final = ("Input per c", "Membership")
_X: Final = np.linspace(-1.5, 1.5, 601)


def _built(center: int, x: FloatArray) -> FloatArray:
    """Membership about -1, 0 or 1, squared in the exponent; the outer two stay one."""
    inside = np.exp(-((x - center) ** 2) / (2 * WIDTH**2))
    return np.where(center * x > 1, 1.0, inside) if center else inside


def _printed(number: int, x: FloatArray) -> FloatArray:
    """(4.26) to the letter for j = 1, 2, 3: no square, centres -1, -0.5, 0."""
    center = -1 + 0.5 * (number - 1)
    with np.errstate(over="ignore"):
        value = np.exp(-0.5 * (x - center) / WIDTH**2)
    if number == 1:
        return np.where(x < center, 1.0, value)
    return np.where(x > center, 1.0, value) if number == 3 else np.asarray(value)


def figure_4_5() -> Figure:
    """Both sets of curves, and whether they are memberships."""
    built = {name: _built(center, _X) for center, name in enumerate(_NAMES, -1)}
    printed = {f"j = {n} ({word})": _printed(n, _X) for n, word in enumerate("PZN", 1)}
    basis = FuzzyBasis((RANGE,) * 4)
    here = np.array([0.3 / RANGE])
    degrees = np.array([_built(center, here)[0] for center in (-1, 0, 1)])
    of_law = basis.memberships(np.array([0.3, 0.0, 0.0, 0.0]))[0]
    same = np.allclose(degrees / degrees.sum(), of_law, rtol=1e-12)
    greatest = max(float(each.max()) for each in printed.values())
    return Figure(
        "formula",
        "The width sigma is not given: here neighbouring sets cross at one half. As printed, the "
        "exponent has no square and the centres are -c, -c/2 and 0; built are -c, 0 and c.",
        (
            panel_of("As built", *_AXES, _X, built, y_limits=(0.0, 1.05)),
            panel_of("(4.26) to the letter", *_AXES, _X, printed, y_limits=(0.0, 5.0)),
        ),
        checks=(
            Check(
                "membership functions have values between zero and one",
                Verdict.of(greatest <= 1),
                f"(4.26) as printed reaches {greatest:.3g} within 1.5 c; with the square "
                f"{max(float(each.max()) for each in built.values()):.0f}",
            ),
            Check(
                "positive, zero and negative correspond with j = 1, 2, 3",
                Verdict.FAILS,
                "the printed centres are -c, -c/2 and 0: the one called positive is the most "
                "negative, and no set is positive",
            ),
            Check(
                "81 rules of four inputs with three sets each",
                Verdict.of(basis.rules == 81 and same),
                f"{basis.rules} rules; the law's basis has these sets, normalized",
            ),
        ),
    )
