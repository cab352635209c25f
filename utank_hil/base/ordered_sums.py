"""Products of arrays whose sums have one order, the same on every processor.

A linear-algebra library chooses its order of summation by processor, shape and memory. Here each
term is rounded, then added: numpy's `multiply` and `add` are single IEEE operations. The sum of n
terms is that of `numpy.add.reduce` over contiguous numbers: from first to last for n < 8; for
n <= 128 in eight interleaved sums, which are joined in pairs, the rest after them; else of two
halves, the first of a multiple of eight terms.
"""

import math

import numpy as np

from utank_hil.base.arrays import FloatArray


def product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a @ b for `a` of shape (n,) or (m, n), and `b` of shape (n,) or (n, k)."""
    # in C order, as the order of a sum follows the memory; a sum from 0 is not -0
    terms = np.multiply(a if b.ndim == 1 else a[..., None, :], b.T, order="C")
    summed: FloatArray = np.add.reduce(terms, axis=-1, initial=0.0)
    return summed


def exponential(a: FloatArray) -> FloatArray:
    """Exponential of a square matrix: twelve terms of its series at 1/8 or less, then squared."""
    size = float(np.abs(a).sum(axis=1).max())
    halvings = max(0, math.frexp(size)[1] + 3)
    small = np.ldexp(a, -halvings)
    total = term = np.eye(len(a))
    for n in range(1, 13):
        term = product(term, small) / n
        total = total + term
    for _ in range(halvings):
        total = product(total, total)
    return total


def orthogonal_triangle(a: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Orthonormal columns Q, shape (m, n), and upper triangle R, shape (n, n), with a = Q R.

    Gram and Schmidt's method, each column twice, which is as exact as reflections (Giraud and
    others, Numerische Mathematik 101, 2005, 87-100).
    """
    orthogonal, triangle = np.zeros(a.shape), np.zeros((a.shape[1],) * 2)
    for n in range(a.shape[1]):
        column = a[:, n]
        for _ in range(2):
            share = product(orthogonal[:, :n].T, column)
            column = column - product(orthogonal[:, :n], share)
            triangle[:n, n] += share
        triangle[n, n] = math.sqrt(product(column, column))
        orthogonal[:, n] = column / triangle[n, n]
    return orthogonal, triangle


def solved(triangle: FloatArray, b: FloatArray) -> FloatArray:
    """Return x with R x = b for an upper triangle R, shape (n, n), and `b` of shape (n, k)."""
    x = np.zeros(b.shape)
    for n in range(len(b) - 1, -1, -1):
        x[n] = (b[n] - product(triangle[n, n + 1 :], x[n + 1 :])) / triangle[n, n]
    return x


def positive_solved(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return x with a x = b for a positive definite `a`, shape (n, n), and `b`, shape (n,)."""
    a, x = a.copy(), b.copy()
    for n in range(len(b)):
        share = a[n + 1 :, n] / a[n, n]
        a[n + 1 :, n:] -= share[:, None] * a[n, n:]
        x[n + 1 :] -= share * x[n]
    return solved(a, x[:, None])[:, 0]
