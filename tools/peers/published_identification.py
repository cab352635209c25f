"""Published subspace identification behind one signature.

Each method is given inputs and outputs of unit size. Block rows are the samples that it looks ahead
and back; 60 are 12 s, a roll period.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from tools.peers import peers_environment
from tools.peers.identification_records import Matrices
from utank_hil.base.arrays import FloatArray

with peers_environment():
    import pandas as pd
    import sippy_unipi
    from mdof import realize
    from nfoursid.nfoursid import NFourSID

Identify = Callable[[FloatArray, FloatArray, int, int], Matrices]
"""From u (N,), y (N, m), order and block rows to A, B, C, D."""


def _sippy(method: str, u: FloatArray, y: FloatArray, order: int, rows: int) -> Matrices:
    found = sippy_unipi.system_identification(
        y.T, u[None], method, SS_fixed_order=order, SS_f=rows, SS_p=rows, SS_D_required=True
    )
    return found.A, found.B, found.C, found.D


def _nfoursid(u: FloatArray, y: FloatArray, order: int, rows: int) -> Matrices:
    outputs = [f"y{i}" for i in range(y.shape[1])]
    frame = pd.DataFrame(np.column_stack([u, y]), columns=["u", *outputs])
    found = NFourSID(frame, outputs, ["u"], num_block_rows=rows)
    found.subspace_identification()
    model, _ = found.system_identification(rank=order)
    return model.a, model.b, model.c, model.d


def _srim(u: FloatArray, y: FloatArray, order: int, rows: int) -> Matrices:
    a, b, c, d = realize.srim(u[None], y.T, order=order, horizon=rows, threads=None)
    return a, b, c, d


def _scaled(identify: Identify) -> Identify:
    def scaled(u: FloatArray, y: FloatArray, order: int, rows: int) -> Matrices:
        size, scale = np.std(u), np.std(y, axis=0)
        a, b, c, d = identify(u / size, y / scale, order, rows)
        return a, b / size, c * scale[:, None], d * scale[:, None] / size

    return scaled


PUBLISHED: dict[str, Identify] = {
    "sippy_unipi N4SID": _scaled(partial(_sippy, "N4SID")),
    "sippy_unipi PARSIM-K": _scaled(partial(_sippy, "PARSIM-K")),
    "nfoursid": _scaled(_nfoursid),
    "mdof SRIM": _scaled(_srim),
}
