"""A ship of another program in the place of the emulated one: its FMU and the table of variables.

Reading a description runs no code of the file; `firmware_sim.fmu_plant` runs it.
"""

import re
import zipfile
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Final
from xml.parsers import expat

from pydantic import BeforeValidator, ValidationInfo, model_validator

from utank_hil.base.parameters import Finite, Problem, refuse
from utank_hil.configuration import Section
from utank_hil.configuration.files import ALLOW_CODE

INPUTS: Final = ("pressure_pa", "wave_moment_nm", "valve_loss_pa_s2_m2")
OUTPUTS: Final = ("roll_rad", "roll_rate_rad_s", "level_m", "flow_m3_s", "lateral_m_s2")
_REALS: Final = ("Real", "Float64")  #: Types of FMI 2 and 3 that carry 64 bits.
_DESCRIPTION: Final = "modelDescription.xml"
_DESCRIPTION_BYTES: Final = 1 << 24  #: Largest description; one of 10,000 variables has 4 MB.
_CONTENT_BYTES: Final = 1 << 29  #: Largest content unpacked; exports with a runtime have 200 MB.
_MOST_PARTS: Final = 10_000  #: Most files within; an exported Python environment has 5,000.
# Exponents of kg, m, s and rad of the bench's units; an angle may count as a pure number.
_DIMENSIONS: Final[dict[str, tuple[int, int, int]]] = {
    "pressure_pa": (1, -1, -2),
    "wave_moment_nm": (1, 2, -2),
    "valve_loss_pa_s2_m2": (1, -3, 0),
    "roll_rad": (0, 0, 0),
    "roll_rate_rad_s": (0, 0, -1),
    "level_m": (0, 1, 0),
    "flow_m3_s": (0, 3, -1),
    "lateral_m_s2": (0, 1, -2),
}


class FmuVariable(Section):
    """Variable of the FMU that carries a quantity of the bench."""

    name: str  #: Name within the FMU.
    scale: Finite | None = None
    """Quantity of the bench per unit of the variable, negative for the opposite sign; by default
    the factor of the unit that the FMU declares, else 1."""


_Variable = Annotated[
    FmuVariable, BeforeValidator(lambda said: {"name": said} if isinstance(said, str) else said)
]


class FmuVariables(Section):
    """Names within the FMU, with signs and directions as those of `firmware_sim.plant.Plant`."""

    roll_rad: _Variable  #: Roll angle, positive to starboard.
    roll_rate_rad_s: _Variable  #: Roll rate.
    level_m: _Variable  #: Starboard level above still water.
    flow_m3_s: _Variable  #: Flow through the duct to starboard.
    lateral_m_s2: _Variable | None = None
    """Lateral acceleration of the centre of gravity; without it none is sensed."""
    pressure_pa: _Variable | None = None  #: Input: pressure rise of the bench's pump.
    wave_moment_nm: _Variable | None = None  #: Input; without it the FMU has waves of its own.
    valve_loss_pa_s2_m2: _Variable | None = None  #: Input: loss of the bench's valve.

    def given(self) -> Iterator[tuple[str, FmuVariable]]:
        """Quantities of the bench with their variables."""
        for name in (*INPUTS, *OUTPUTS):
            variable = getattr(self, name)
            if variable is not None:
                yield name, variable


class FmuFile(Section):
    """Functional Mock-up Unit for co-simulation, of FMI 2 or 3."""

    file: Path  #: File of the unit.
    variables: FmuVariables  #: Its variables that carry the quantities of the bench.
    parameters: dict[str, Finite] = {}  # noqa: RUF012, a field of a frozen section
    """Start values by names in the FMU, in its units."""

    @model_validator(mode="before")
    @classmethod
    def _code_allowed(cls, content: Any, info: ValidationInfo) -> Any:
        if isinstance(content, dict) and not (info.context or {}).get(ALLOW_CODE):
            reason = (
                "runs native code that the file holds; allow it by --allow-code if you trust it"
            )
            refuse("fmu", [("file", reason)])
        return content

    @model_validator(mode="after")
    def _fits(self) -> "FmuFile":
        try:
            description = read_description(self.file)
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            refuse("fmu", [("file", f"{self.file.name} can't be used: {why}")])
        known = {each.name: each for each in description.modelVariables}
        problems: list[Problem] = []
        for quantity, variable in self.variables.given():
            wanted = "input" if quantity in INPUTS else "output"
            reason = _unfit(description, known, variable, quantity, wanted)
            problems += [(f"variables.{quantity}", reason)] if reason else []
        for name in self.parameters:
            reason = _no_real(known, name)
            if not reason and known[name].causality in ("input", "output", "independent"):
                reason = f"{name!r} is an {known[name].causality}, no parameter"
            problems += [(f"parameters.{name}", reason)] if reason else []
        refuse("fmu", problems)
        return self


def _no_real(known: dict[str, Any], name: str) -> str:
    if name not in known:
        alike = [each for each in sorted(known) if not each.startswith("der(")][:10]
        return f"is {name!r}, which the FMU has not; it has {', '.join(alike) or 'none'}"
    variable = known[name]
    if variable.type not in _REALS or variable.dimensions:
        return f"is {name!r}, which is no single number of 64 bits: take one of {_REALS[-1]}"
    return ""


def _unfit(
    description: Any, known: dict[str, Any], variable: FmuVariable, quantity: str, wanted: str
) -> str:
    """Return why a variable of the FMU can't carry a quantity; empty if it can."""
    if reason := _no_real(known, variable.name):
        return reason
    found = known[variable.name]
    if found.causality != wanted and not (wanted == "output" and found.causality == "local"):
        return f"is {variable.name!r}, which is {found.causality} and no {wanted}: take another"
    if variable.scale == 0:
        return "has a scale of 0: give the quantity per unit of the variable"
    unit = _base_unit(description, found)
    if unit is not None and variable.scale is None:
        dimension = unit.kg, unit.m, unit.s
        others = unit.A, unit.K, unit.mol, unit.cd
        if dimension != _DIMENSIONS[quantity] or any(others) or unit.offset:
            return f"is {variable.name!r} in {found.unit}: no unit of this; give a scale if it is"
    return ""


def _base_unit(description: Any, variable: Any) -> Any:
    """Return the unit that the FMU declares in terms of SI units, if it does."""
    name = variable.unit or (variable.declaredType and variable.declaredType.unit)
    units = {unit.name: unit.baseUnit for unit in description.unitDefinitions}
    return units.get(name)


def scale_of(variable: FmuVariable, description: Any, found: Any) -> float:
    """Quantity of the bench per unit of a variable of the description."""
    unit = _base_unit(description, found)
    declared = 1.0 if unit is None else float(unit.factor)
    return declared if variable.scale is None else variable.scale


def read_description(path: Path) -> Any:
    """Read the description of an FMU as `fmpy.model_description.ModelDescription`.

    ValueError is raised for a file that is no FMU for co-simulation, is damaged, too large, or
    would leave its folder when it is unpacked.
    """
    from fmpy import read_model_description

    try:
        with path.open("rb") as file:  # FMPy leaves open what it refuses.
            with zipfile.ZipFile(file) as archive:
                _refuse_parts(archive)
                _refuse_document_type(archive.read(_DESCRIPTION))
            description = read_model_description(file)
    except OSError:
        raise
    except Exception as error:  # Readers raise any exception at a damaged file.
        raise ValueError(" ".join(str(error).split()) or type(error).__name__) from error
    if description.fmiVersion == "1.0" or description.coSimulation is None:
        raise ValueError("it is no co-simulation of FMI 2 or 3: export it as that")
    identifier = description.coSimulation.modelIdentifier
    if not re.fullmatch(r"\w+", identifier or ""):  # It names the library within.
        raise ValueError(f"its model identifier {identifier!r} is no identifier")
    return description


def unpack(path: Path, folder: Path) -> None:
    """Unpack an FMU into a folder; ValueError if a part would leave it or all is too large."""
    with zipfile.ZipFile(path) as archive:
        _refuse_parts(archive)
        archive.extractall(folder)


def _refuse_parts(archive: zipfile.ZipFile) -> None:
    parts = archive.infolist()
    if len(parts) > _MOST_PARTS or sum(each.file_size for each in parts) > _CONTENT_BYTES:
        limits = f"{_MOST_PARTS} files and {_CONTENT_BYTES >> 20} MB"
        raise ValueError(f"it unpacks to more than {limits}, the most that is read")
    for part in parts:
        name = PurePosixPath(part.filename)
        if name.is_absolute() or ".." in name.parts or set(part.filename) & set("\\:"):
            raise ValueError(f"its part {part.filename!r} would leave the folder of the FMU")
        if part.filename == _DESCRIPTION and part.file_size > _DESCRIPTION_BYTES:
            raise ValueError(f"its {_DESCRIPTION} is larger than {_DESCRIPTION_BYTES >> 20} MB")
    if _DESCRIPTION not in archive.namelist():
        raise ValueError(f"it is no FMU: it has no {_DESCRIPTION}")


def _refuse_document_type(content: bytes) -> None:
    """Refuse a declaration of entities, by which a description may read files or multiply."""

    def refused(*_: object) -> None:
        raise ValueError(f"its {_DESCRIPTION} declares a document type, which no FMU needs")

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refused
    parser.Parse(content, True)
