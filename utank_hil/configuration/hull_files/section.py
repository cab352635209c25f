"""The section ``hull`` of a file: hull data, and what they lack."""

from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import model_validator

from utank_hil.base.parameters import Finite, Positive, Range
from utank_hil.configuration.files import Section
from utank_hil.configuration.hull_files.parts import Given
from utank_hil.configuration.hull_files.reader import read_hull
from utank_hil.dynamics.hull.lateral import LateralHull


class HullFile(Section):
    """Hull data as seakeeping codes write them, and what their file lacks."""

    file: Path
    """Capytaine's netCDF, WAMIT's .1, Nemoh.cal, AQWA's .AH1, ShipX's .re7 or MSS's .mat."""
    density_kg_m3: Annotated[float, Range(least=900, most=1100)] | None = None
    """Density of the water."""
    mass_kg: Positive | None = None  #: Mass of the ship without the tank's water.
    gravity_centre_m: tuple[Finite, Finite, Finite] | None = None
    """Centre of gravity forward, to port and up of the origin in the waterline."""
    gyration_m: tuple[Positive, Positive, Positive] | None = None
    """Radii of gyration about the centre of gravity in roll, pitch and yaw."""

    @model_validator(mode="before")
    @classmethod
    def _by_file(cls, content: Any) -> Any:
        return {"file": content} if isinstance(content, str) else content

    @property
    def hull(self) -> LateralHull:
        """The hull; ValueError says what it lacks."""
        given = Given(self.density_kg_m3, self.mass_kg, self.gravity_centre_m, self.gyration_m)
        return _lateral_hull(self.file, given)


@lru_cache(maxsize=4)
def _lateral_hull(path: Path, given: Given) -> LateralHull:
    return LateralHull(read_hull(path, given))
