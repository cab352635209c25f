"""ShipX (VERES): ``.re7`` with the ``.re8`` beside it, and MSS's structure of it or of WAMIT.

ShipX: x aft, y to starboard, z up, heading 0 in a head sea, time exp(+i w_e t). MSS: x forward,
y to starboard, z down, headings to starboard.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.configuration.hull_files import parts
from utank_hil.configuration.matrices import read_mat
from utank_hil.dynamics.hull.hull_data import TO_BODY_AXES, HullData, inverse_shift, wave_number

_FROM_SHIPX = np.array([-1.0, -1, 1, -1, -1, 1])
_LEAST_OF_NEXT = 0.7
"""VERES may halve the lateral added mass of the longest wave: 0.52 of the next row was seen."""
_INFINITE_RAD_S = 10.0  #: MSS writes WAMIT's infinite frequency as this.


def read_shipx(path: Path, given: parts.Given) -> HullData:  # noqa: ARG001, the same for all readers
    """Read a ``.re7`` of one speed, zero, and its ``.re8``."""
    wave_file = parts.sibling(path, ".re8")
    if wave_file is None:
        raise ValueError(f"{path}: the excitation is missing: put the .re8 beside it")
    rows, other = _rows(path), _rows(wave_file)
    density, gravity = next(rows)[:2]
    draught = next(rows)[2]
    aft, above_keel = next(rows)[:2]
    counts = next(rows)
    if counts[0] != -1:
        raise ValueError(f"{path}: is of version 1, without added matrices: export it anew")
    speeds, headings, count, _ = (int(each) for each in next(rows))
    mass = _SIGN * _square(rows)
    start = next(rows)
    if speeds != 1 or start[0] != 0:
        raise ValueError(
            f"{path}: must be of the one speed zero, has {speeds} from {start[0]:g} m/s"
        )
    for _ in range(4):
        next(other)
    if next(other) != start:
        raise ValueError(f"{wave_file}: is of another run than {path.name}: their points differ")
    omega = np.empty(count)
    radiation = np.empty((count, 6, 6, 6))
    viscous = np.empty((count, 2))
    toward, force = np.empty(headings), np.empty((headings, count, 6), dtype=np.complex128)
    for m in range(headings):
        toward[m] = parts.half_turn(next(rows)[0] + 180)
        next(other)
        for n in range(count):
            omega[n] = next(rows)[0]  # at rest, all headings have the same coefficients
            radiation[n] = [_SIGN * _square(rows) for _ in range(6)]
            viscous[n] = next(rows)[:2]
            next(other)
            force[m, n] = [complex(*next(other)[1:3]) for _ in range(6)]
    keep = _sound_rows(radiation[:, 0])
    order = np.argsort(toward)
    reference = np.array([0.0, 0.0, start[4] - draught])
    body = parts.rigid_body(mass, reference)
    body["gravity_centre_m"] = np.array([start[3] - aft, 0.0, above_keel - draught])
    return parts.hull_of(
        path,
        [
            "added matrices of the run (tanks, fins) are left out"
            if radiation[:, 1::2].any()
            else "",
            _NOT_SOUND if keep.start else "",
            "surge has no added mass: strip theory" if not radiation[:, 0, 0, 0].any() else "",
        ],
        frequency_rad_s=omega[keep],
        added_mass=radiation[keep, 0],
        damping=radiation[keep, 2],
        wave_frequency_rad_s=omega[keep],
        heading_deg=toward[order],
        excitation=_FROM_SHIPX * force[order][:, keep],
        hydrostatic=radiation[-1, 4],
        viscous_roll_nms_rad=viscous[keep, 0],
        quadratic_roll_nms2_rad2=viscous[keep, 1],
        reference_m=reference,
        density_kg_m3=density,
        gravity_m_s2=gravity,
        **body,
    )


_NOT_SOUND = "the longest wave is left out: its sway added mass is not that of the next"


def _sound_rows(added: FloatArray) -> slice:
    """Return which rows to keep: all, or all but that of the longest wave."""
    return slice(1 if added[0, 1, 1] < _LEAST_OF_NEXT * added[1, 1, 1] else 0, None)


_SIGN = np.outer(_FROM_SHIPX, _FROM_SHIPX)


def _rows(path: Path) -> Iterator[list[float]]:
    """Return the rows of numbers after the six lines of text."""
    for line in parts.text(path).splitlines()[6:]:
        if row := parts.floats(line):
            yield row
    raise ValueError(f"{path}: ends too early")


def _square(rows: Iterator[list[float]]) -> FloatArray:
    return np.array([next(rows)[:6] for _ in range(6)])


def read_mss(path: Path, given: parts.Given) -> HullData:  # noqa: ARG001, the same for all readers
    """Read MSS's structure ``vessel`` of a ``.mat``, up to version 7."""
    try:
        vessel = read_mat(path, squeeze_me=True, struct_as_record=False)["vessel"]
        main, force = vessel.main, vessel.forceRAO
        speeds = np.atleast_1d(vessel.velocities)
        at_rest = int(np.flatnonzero(speeds == 0)[0])
        first = np.asarray(vessel.freqs, dtype=np.float64)
        added, damping, stiff = (
            _SIGN_MSS * _by_frequency(getattr(vessel, name), at_rest) for name in "ABC"
        )
        amplitude, phase = (
            np.array([np.asarray(each)[..., at_rest] for each in cells])
            for cells in (force.amp, force.phase)
        )
        waves = np.asarray(force.w, dtype=np.float64)
        headings = -np.degrees(np.asarray(vessel.headings, dtype=np.float64))
        density, gravity = float(main.rho), float(main.g)
        body = parts.rigid_body(_SIGN_MSS * np.asarray(vessel.MRB, dtype=np.float64))
    except (OSError, KeyError, AttributeError, IndexError) as error:
        raise ValueError(
            f"{path} is no structure of MSS with a speed of zero: {error!r}"
        ) from error
    headings = parts.half_turn(headings)
    order = np.argsort(headings)
    excitation: ComplexArray = TO_BODY_AXES * (amplitude * np.exp(1j * phase)).transpose(2, 1, 0)
    excitation = excitation[order]
    notes = ["roll damping of the structure is MSS's own estimate: left out"]
    if hasattr(vessel, "roll"):  # of ShipX: forces refer to the centre's x, matrices to midship
        k = wave_number(waves, np.inf, gravity)
        place = np.array([float(main.CG[0]), 0.0, 0.0])
        excitation = excitation * parts.phase_at(place, headings[order], k) @ inverse_shift(-place)
        notes.append("surge added mass and damping are MSS's guesses from sway")
    inside = np.flatnonzero((first > 0) & (first < _INFINITE_RAD_S))
    keep = _sound_rows(added[inside])
    inside = inside[keep]
    notes.append(_NOT_SOUND if keep.start else "")
    limit = added[first == _INFINITE_RAD_S]
    return parts.hull_of(
        path,
        notes,
        frequency_rad_s=first[inside],
        added_mass=added[inside],
        damping=damping[inside],
        wave_frequency_rad_s=waves[keep],
        heading_deg=headings[order],
        excitation=excitation[:, keep],
        hydrostatic=stiff[-1],
        density_kg_m3=density,
        gravity_m_s2=gravity,
        infinite_added_mass=limit[0] if len(limit) else None,
        **body,
    )


_SIGN_MSS = np.outer(TO_BODY_AXES, TO_BODY_AXES)


def _by_frequency(matrices: npt.ArrayLike, at_rest: int) -> FloatArray:
    array = np.asarray(matrices, dtype=np.float64)
    return np.moveaxis(array[..., at_rest] if array.ndim == 4 else array, 2, 0)
