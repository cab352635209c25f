"""Published identification packages behind one signature, as far as they are installed."""

import importlib
from collections.abc import Callable
from typing import Any

import numpy as np

from utank_hil.arrays import FloatArray

Identify = Callable[[FloatArray, FloatArray], tuple[FloatArray, ...]]

ORDER = 4
HORIZON = 60  # block rows: 12 s, a roll period


def published() -> dict[str, Identify]:
    """Methods by name; each takes u (N,) and y (N, m) and returns A, B, C, D of order 4."""
    methods: dict[str, Identify] = {}
    sippy = _installed("sippy_unipi")
    if sippy is not None:
        for name in ("N4SID", "PARSIM-K"):
            methods[f"sippy {name}"] = _scaled(_sippy(sippy, name))
    pandas, nfoursid = _installed("pandas"), _installed("nfoursid.nfoursid")
    if pandas is not None and nfoursid is not None:
        methods["nfoursid"] = _scaled(_nfoursid(pandas, nfoursid))
    mdof = _installed("mdof.realize")
    if mdof is not None:
        methods["mdof SRIM"] = _scaled(
            lambda u, y: mdof.srim(u[None], y.T, order=ORDER, horizon=HORIZON, threads=None)
        )
    return methods


def _installed(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


def _scaled(identify: Identify) -> Identify:
    """Give a method inputs and outputs of unit size, and undo that in its model."""

    def scaled(u: FloatArray, y: FloatArray) -> tuple[FloatArray, ...]:
        size, scale = np.std(u), np.std(y, axis=0)
        a, b, c, d = identify(u / size, y / scale)
        return a, b / size, c * scale[:, None], d * scale[:, None] / size

    return scaled


def _sippy(package: Any, method: str) -> Identify:
    def identify(u: FloatArray, y: FloatArray) -> tuple[FloatArray, ...]:
        found = package.system_identification(
            y.T,
            u[None],
            method,
            SS_fixed_order=ORDER,
            SS_f=HORIZON,
            SS_p=HORIZON,
            SS_D_required=True,
        )
        return found.A, found.B, found.C, found.D

    return identify


def _nfoursid(pandas: Any, package: Any) -> Identify:
    def identify(u: FloatArray, y: FloatArray) -> tuple[FloatArray, ...]:
        outputs = [f"y{i}" for i in range(y.shape[1])]
        frame = pandas.DataFrame(np.column_stack([u, y]), columns=["u", *outputs])
        found = package.NFourSID(frame, outputs, ["u"], num_block_rows=HORIZON)
        found.subspace_identification()
        model = found.system_identification(rank=ORDER)[0]
        return model.a, model.b, model.c, model.d

    return identify
