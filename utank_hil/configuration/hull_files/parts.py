"""What readers of hull data have in common."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.base.parameters import Finite, Positive, Range
from utank_hil.base.text_files import open_content, unread
from utank_hil.configuration.files import Section
from utank_hil.dynamics.hull.hull_data import HullData

GRAVITY_M_S2 = 9.81  #: For codes that write none into their numeric files.


class Given(Section):
    """What a user knows of the hull besides its file, for what the file lacks."""

    density_kg_m3: Annotated[float, Range(least=900, most=1100)] | None = None
    """Density of the water."""
    mass_kg: Positive | None = None  #: Mass of the ship without the tank's water.
    gravity_centre_m: tuple[Finite, Finite, Finite] | None = None
    """Centre of gravity forward, to port and up of the origin in the waterline."""
    gyration_m: tuple[Positive, Positive, Positive] | None = None
    """Radii of gyration about the centre of gravity in roll, pitch and yaw."""


def rigid_body(matrix: npt.ArrayLike, reference_m: npt.ArrayLike = (0, 0, 0)) -> dict[str, Any]:
    """Return mass, centre of gravity and inertia about it of a mass matrix about a point.

    The inertia is left out where the whole diagonal is the mass, which is a placeholder.
    """
    m = np.asarray(matrix, dtype=np.float64)
    mass = m[0, 0]
    arm = np.array([m[1, 5], m[2, 3], m[0, 4]]) / mass
    body: dict[str, Any] = {
        "mass_kg": float(mass),
        "gravity_centre_m": arm + np.asarray(reference_m, dtype=np.float64),
    }
    if not np.allclose(np.diag(m), mass):
        body["inertia_kg_m2"] = m[3:, 3:] - mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return body


def hull_of(path: Path, notes: Iterable[str] = (), **fields: Any) -> HullData:
    """Return the hull of a file, by its name, without the notes that are empty."""
    return HullData(**fields, source=str(path), notes=tuple(filter(None, notes)))


def floats(line: str) -> list[float]:
    """Return the numbers at the beginning of a line."""
    found: list[float] = []
    for word in line.replace(",", " ").split():
        try:
            found.append(float(word))
        except ValueError:
            break
    return found


def table(path: Path, least_columns: int) -> list[list[float]]:
    """Return the rows of a file of numbers; a first line of text is left out.

    ValueError names file and line if another row has fewer numbers, or one that is not finite.
    """
    rows = []
    for number, line in enumerate(text(path).splitlines(), 1):
        row = floats(line)
        if len(row) >= least_columns:
            if not np.isfinite(row).all():
                raise ValueError(f"{path}: line {number} has a number that is not finite: {line!r}")
            rows.append(row)
        elif line.strip() and number > 1:
            raise ValueError(f"{path}: line {number} has not {least_columns} numbers: {line!r}")
    if not rows:
        raise ValueError(f"{path} holds no numbers")
    return rows


def mode(path: Path, number: float) -> int:
    """Return the place of a rigid-body mode, 1 to 6 in a file; ValueError for any other."""
    if number not in range(1, 7):
        raise ValueError(
            f"{path}: mode {number:g}: one body has 1 to 6; several bodies, or more degrees, "
            "are not read"
        )
    return int(number) - 1


_LIMIT_BYTES: Final = 1 << 28  #: Of a text; ShipX's of many speeds have some 50 MB.


def text(path: Path) -> str:
    """Return a file's text; ValueError if it can't be read."""
    try:
        with open_content(path, _LIMIT_BYTES) as content:
            return content.read().decode("latin-1")
    except OSError as error:
        raise ValueError(unread(error)) from error


def sibling(path: Path, suffix: str) -> Path | None:
    """Return the file of the same name with another suffix in any case, if there is one."""
    names = (path.with_suffix(each) for each in (suffix, suffix.upper()))
    return next((each for each in names if each.is_file()), None)


def half_turn(heading_deg: float | FloatArray) -> FloatArray:
    """Return headings above -180 and up to 180 degrees, to a thousandth of a degree."""
    return np.asarray(180 - np.mod(180 - np.round(heading_deg, 3), 360))


def phase_at(
    place_m: npt.ArrayLike, heading_deg: FloatArray, wave_number_per_m: FloatArray
) -> npt.NDArray[np.complex128]:
    """Return a wave of amplitude 1 at a place: exp(-i k (x cos b + y sin b)), shape (m, k, 1)."""
    x, y = np.asarray(place_m, dtype=np.float64)[:2]
    b = np.radians(heading_deg)
    along = x * np.cos(b) + y * np.sin(b)
    return np.asarray(np.exp(-1j * wave_number_per_m[None, :, None] * along[:, None, None]))
