"""Elementary functions made of additions, products, divisions and roots alone, in a fixed order.

Those of the C library and of numpy choose their code by the processor. With and without fused
products, glibc's differ in the last bit of one in 1500 results, ``x**2`` included, which is its
`pow`. These have the same bits on every machine of IEEE 754 arithmetic, plain or compiled by numba
or mypyc without contraction; their errors are below two units in the last place. Methods and
coefficients of `exp`, `log` and `sine_cosine`: fdlibm (Sun Microsystems, 1993).
"""

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray

_LOG2_HIGH: Final = 6.93147180369123816490e-01  # 32 bits: its products with exponents are exact
_LOG2_LOW: Final = 1.90821492927058770002e-10
_QUARTER_HIGH: Final = 1.57079632673412561417  # 33 bits of pi/2
_QUARTER_LOW: Final = 6.07710050650619224932e-11
_GREATEST: Final = 709.782712893384  # exp of more overflows
_LEAST: Final = -745.1332191019412  # exp of less is zero


def each(function: Callable[[float], float], values: FloatArray) -> FloatArray:
    """The function of each element."""
    return np.array([function(x) for x in values.ravel().tolist()]).reshape(values.shape)


def exp(x: float) -> float:
    """Exponential function."""
    if not _LEAST < x < _GREATEST:
        return 0.0 if x < 0 else x + math.inf
    exponent = math.floor(x * 1.4426950408889634 + 0.5)
    high, low = x - exponent * _LOG2_HIGH, exponent * _LOG2_LOW
    r = high - low
    z = r * r
    c = 6.61375632143793436117e-05 + z * (-1.65339022054652515390e-06 + z * 4.13813679705723846e-08)
    c = r - z * (1.66666666666666019037e-01 + z * (-2.77777777770155933842e-03 + z * c))
    return math.ldexp(1.0 - ((low - r * c / (2.0 - c)) - high), exponent)


def log(x: float) -> float:
    """Natural logarithm of a positive, finite number."""
    part, exponent = math.frexp(x)
    if part < 0.7071067811865476:
        part, exponent = 2.0 * part, exponent - 1
    f = part - 1.0
    s = f / (2.0 + f)
    z = s * s
    r = 1.818357216161805012e-01 + z * (1.531383769920937332e-01 + z * 1.479819860511658591e-01)
    r = 2.857142874366239149e-01 + z * (2.222219843214978396e-01 + z * r)
    r = z * (6.666666666666735130e-01 + z * (3.999999999940941908e-01 + z * r))
    square = 0.5 * f * f
    return exponent * _LOG2_HIGH - ((square - (s * (square + r) + exponent * _LOG2_LOW)) - f)


def tanh(x: float) -> float:
    """Hyperbolic tangent."""
    z = x * x
    if z < 0.06:  # Lambert's continued fraction; the quotient below would lose digits
        return x / (1 + z / (3 + z / (5 + z / (7 + z / (9 + z / 11)))))
    left = exp(-2.0 * abs(x))
    return math.copysign((1.0 - left) / (1.0 + left), x)


def sine_cosine(angle: float) -> tuple[float, float]:
    """Sine and cosine, to 2e-16 for angles of up to 1e5 radians; NaN for no finite angle.

    From 1e9 on turns of the nearest double to 2 pi are taken off: errors of up to 4e-17 abs(angle).
    """
    if not abs(angle) < 1e9:
        if not abs(angle) < math.inf:
            return math.nan, math.nan
        left = abs(angle) % (2 * math.pi)  # exact, so the same on every machine
        angle = math.copysign(left, angle)
    quarter = math.floor(angle * (2 / math.pi) + 0.5)
    r = (angle - quarter * _QUARTER_HIGH) - quarter * _QUARTER_LOW
    z = r * r
    sin = -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10
    sin = -1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 + z * sin)
    sin = r + r * z * (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z * sin))
    cos = 2.08757232129817482790e-09 - z * 1.13596475577881948265e-11
    cos = 2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 + z * cos)
    cos = 4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * cos)
    cos = 1 - 0.5 * z + z * z * cos
    if quarter == 0:
        return sin, cos
    turn = quarter & 3
    if turn & 1:
        sin, cos = cos, -sin
    return (-sin, -cos) if turn & 2 else (sin, cos)


def sines_cosines(angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sines and cosines of angles, as `sine_cosine`."""
    both = np.array([sine_cosine(x) for x in angles.ravel().tolist()]).reshape(*angles.shape, 2)
    return both[..., 0], both[..., 1]


def phasors(size: FloatArray | float, angles: FloatArray) -> ComplexArray:
    """Complex numbers of these sizes and angles."""
    sines, cosines = sines_cosines(angles)
    real = size * cosines
    result = np.empty(real.shape, dtype=np.complex128)
    result.real, result.imag = real, size * sines
    return result


def sizes(values: ComplexArray) -> FloatArray:
    """Absolute values of complex numbers."""
    return np.sqrt(values.real * values.real + values.imag * values.imag)


def angles_of(values: ComplexArray) -> FloatArray:
    """Angles of complex numbers, -pi to pi."""
    pairs = zip(values.imag.ravel().tolist(), values.real.ravel().tolist(), strict=True)
    return np.array([arctan2(y, x) for y, x in pairs]).reshape(values.shape)


def arctan2(y: float, x: float) -> float:
    """Angle of the point (x, y), -pi to pi."""
    if x == 0.0 and y == 0.0:
        return 0.0
    steep = abs(y) > abs(x)
    t = abs(x / y) if steep else abs(y / x)
    for _ in range(2):  # half the angle, twice: it is below 0.2 then
        t = t / (1.0 + math.sqrt(1.0 + t * t))
    z = t * t
    tail = 0.0
    for odd in range(23, 1, -2):
        tail = z * (1.0 / odd - tail)
    angle = 4.0 * (t - t * tail)
    if steep:
        angle = math.pi / 2 - angle
    return math.copysign(math.pi - angle if x < 0 else angle, y)
