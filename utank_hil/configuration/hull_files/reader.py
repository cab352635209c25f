"""Hull data of any code, by the name of its file."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import model_validator

from utank_hil.configuration.hull_files.aqwa import read_aqwa
from utank_hil.configuration.hull_files.capytaine import read_capytaine
from utank_hil.configuration.hull_files.nemoh import read_nemoh
from utank_hil.configuration.hull_files.parts import Given
from utank_hil.configuration.hull_files.shipx import read_mss, read_shipx
from utank_hil.configuration.hull_files.wamit import read_wamit
from utank_hil.dynamics.hull.hull_data import HullData
from utank_hil.dynamics.hull.lateral import LateralHull

_READERS: dict[str, Callable[[Path, Given], HullData]] = {
    ".nc": read_capytaine,
    ".1": read_wamit,
    ".cal": read_nemoh,
    ".ah1": read_aqwa,
    ".re7": read_shipx,
    ".mat": read_mss,
}
_SAME = 0.01  #: Relative difference up to which figures of user and file are the same.


def read_hull(path: Path, given: Given | None = None) -> HullData:
    """Read the hull data of a seakeeping code.

    `path` is Capytaine's ``.nc``, WAMIT's ``.1``, NEMOH's ``Nemoh.cal``, AQWA's ``.AH1``, ShipX's
    ``.re7`` or MSS's ``.mat``. Further files of the code are sought beside it; `given` is what they
    lack. ValueError is raised if the file is of no known code, incomplete or wrong, or has a figure
    that `given` has otherwise.
    """
    known = Given() if given is None else given
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        kinds = (
            "Capytaine .nc, WAMIT .1, NEMOH Nemoh.cal, AQWA .AH1, ShipX .re7, MSS .mat; of a mesh "
            "`utank-hil hull` computes a .nc"
        )
        raise ValueError(f"{path} is of no known kind; known are {kinds}")
    try:
        hull = reader(path, known)
    except (LookupError, ArithmeticError, StopIteration, RuntimeError, TypeError) as error:
        raise ValueError(f"{path} is incomplete, or not what its name says: {error!r}") from error
    except ValueError as error:
        folder = "" if path.parent == Path() else str(path.parent)
        if str(path) in str(error) or (folder and folder in str(error)):
            raise
        raise ValueError(f"{path}: {error}") from error
    return completed(hull, known)


def completed(hull: HullData, given: Given) -> HullData:
    """Return a hull with what a user knows where it lacks that; `ValueError` where it differs."""
    mass = hull.mass_kg if given.mass_kg is None else given.mass_kg
    inertia = None
    if given.gyration_m is not None:
        if mass is None:
            raise ValueError(f"{hull.source}: mass_kg is missing beside gyration_m")
        inertia = mass * np.diag(np.square(given.gyration_m))
    wanted = {
        "density_kg_m3": given.density_kg_m3,
        "mass_kg": given.mass_kg,
        "gravity_centre_m": given.gravity_centre_m,
        "inertia_kg_m2": inertia,
    }
    new: dict[str, Any] = {name: of for name, of in wanted.items() if of is not None}
    for name in list(new):
        own = getattr(hull, name)
        if own is None:
            continue
        size = max(float(np.max(np.abs(own))), 1e-9)
        if np.max(np.abs(own - np.asarray(new[name]))) > _SAME * max(size, 1e-3):
            what = "gyration_m: the inertia" if name == "inertia_kg_m2" else f"{name}: it"
            figures = np.diag(own) if np.ndim(own) == 2 else np.atleast_1d(own)
            said = ", ".join(f"{figure:.5g}" for figure in figures)
            raise ValueError(f"{hull.source}: remove {what} is {said} in the file")
        del new[name]
    return replace(hull, **new)


class HullFile(Given):
    """Hull data as seakeeping codes write them, and what their file lacks."""

    file: Path
    """Capytaine's netCDF, WAMIT's .1, Nemoh.cal, AQWA's .AH1, ShipX's .re7 or MSS's .mat."""

    @model_validator(mode="before")
    @classmethod
    def _by_file(cls, content: Any) -> Any:
        return {"file": content} if isinstance(content, str) else content

    @property
    def hull(self) -> LateralHull:
        """The hull; ValueError says what it lacks."""
        return _lateral_hull(self)


@lru_cache(maxsize=4)
def _lateral_hull(section: HullFile) -> LateralHull:
    return LateralHull(read_hull(section.file, section))
