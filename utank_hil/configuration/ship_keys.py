"""The section ``ship`` of a file: `RollShip`, also in the keys of a naval architect.

With displacement D in kg, metacentric height GM, roll period T and damping ratio zeta, all of the
ship without the tank's water::

    stiffness = D g GM        inertia = stiffness (T / 2 pi)^2
    linear damping = 2 zeta sqrt(inertia stiffness)

What is not given is taken from ``hull``, if there are hull data: mass, C44, and inertia and damping
of the free roll with sway and yaw free. Else a missing period is that of the weather criterion, IS
Code 2008, part A, 2.3.4 (beam B, mean draught d, length L at the waterline)::

    T = 2 C B / sqrt(GM),     C = 0.373 + 0.023 B / d - 0.043 L / 100
"""

import math
from collections.abc import Callable, Collection
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import PlainSerializer, WrapValidator

from utank_hil.base.parameters import ParameterError, Problem, Range, refuse
from utank_hil.configuration.hull_files.reader import HullFile
from utank_hil.dynamics import GRAVITY_M_S2, RollShip

NOT_GIVEN = math.nan  #: Mark of a missing key; no key of a file can have this value.

_PAIRS = (
    ("displacement_t", "displacement_n"),
    ("gm_m", "stiffness_nm_rad"),
    ("roll_period_s", "inertia_kg_m2"),
    ("damping_ratio", "damping_nms_rad"),
)  # Pairs of a naval architect's key and `RollShip`'s for the same quantity.

_HULL_KEYS = (
    "density_kg_m3, mass_kg, gravity_centre_m, gyration_m beside hull.file give what a file lacks"
)
_UNITS = {
    "displacement_t": "it is in tonnes",
    "gm_m": "it is in metres, and roll_period_s in seconds",
    "roll_period_s": "it is in seconds, of a whole swing to both sides",
    "damping_ratio": "it is a share of critical damping, 10 % is 0.10",
    "beam_m": "it is in metres; give roll_period_s if it is known",
}

_SEA_WATER_T_M3 = 1.025
_BLOCK = (0.2, 1.1)
"""Block coefficients of any hull, from a sailing yacht's with its keel to a pontoon's."""
_MOST = 1e30  # as for `RollShip`; the keys below keep what is computed from them within it
_Length = Annotated[float, Range(above=0, most=1e4)]


def weather_criterion_period_s(
    beam_m: float, draught_m: float, length_m: float, gm_m: float
) -> float:
    """Roll period, IS Code 2008 (part A, 2.3.4), by moulded beam, mean draught and waterline."""
    coefficient = 0.373 + 0.023 * beam_m / draught_m - 0.043 * length_m / 100
    return 2 * coefficient * beam_m / math.sqrt(gm_m)


@dataclass(frozen=True, slots=True)
class WrittenShip(RollShip):
    """A ship as written in a file: each quantity by one of its possible keys.

    ValueError is raised if a quantity is given twice or not at all.
    """

    inertia_kg_m2: Annotated[float, Range(above=0, most=_MOST)] = NOT_GIVEN
    stiffness_nm_rad: Annotated[float, Range(above=0, most=_MOST)] = NOT_GIVEN
    damping_nms_rad: Annotated[float, Range(least=0, most=_MOST)] = NOT_GIVEN
    displacement_n: Annotated[float, Range(least=0, most=_MOST)] = NOT_GIVEN
    #: Displacement of the ship without the tank's water; instead of `displacement_n`.
    displacement_t: Annotated[float, Range(above=0, most=1e9)] = NOT_GIVEN
    #: Metacentric height without the tank's water; with `displacement_t` instead of
    #: `stiffness_nm_rad`.
    gm_m: Annotated[float, Range(above=0, most=1e3)] = NOT_GIVEN
    #: Natural roll period without the tank's water; instead of `inertia_kg_m2`.
    roll_period_s: Annotated[float, Range(above=0, most=1e4)] = NOT_GIVEN
    #: Dimensions of the hull at the waterline; instead of `roll_period_s`.
    beam_m: _Length = NOT_GIVEN
    #: Dimensions of the hull at the waterline; instead of `roll_period_s`.
    draught_m: _Length = NOT_GIVEN
    #: Dimensions of the hull at the waterline; instead of `roll_period_s`.
    length_m: _Length = NOT_GIVEN
    #: Damping ratio of the ship's roll; instead of `damping_nms_rad`.
    damping_ratio: Annotated[float, Range(least=0, most=1e3)] = NOT_GIVEN
    #: Hull data of a seakeeping code, by their file or as a section, for what no key here gives:
    #: displacement, stiffness, inertia and damping. For a bench (`emulated`).
    hull: HullFile | None = None

    def __post_init__(self) -> None:
        twice = [
            (own, f"and {other} give the same quantity: remove one of them")
            for own, other in _PAIRS
            if self.gives(own) and self.gives(other)
        ]
        refuse("ship", twice or self._missing() or self._form_problems())

    def gives(self, name: str) -> bool:
        """Whether the file has a key."""
        return not math.isnan(getattr(self, name))

    @property
    def period_by_formula(self) -> bool:
        """Whether the roll period is the weather criterion's."""
        given = self.gives("roll_period_s") or self.gives("inertia_kg_m2")
        return self.hull is None and not given

    def ship(self) -> RollShip:
        """Return the ship as a `RollShip`, with its errors."""
        hull = self._of_hull()
        displacement_n = self._displacement_n
        if hull is not None and math.isnan(displacement_n):
            displacement_n = hull.displacement_n
        stiffness = displacement_n * self.gm_m if self.gives("gm_m") else self.stiffness_nm_rad
        inertia = self.inertia_kg_m2
        if hull is not None:
            if math.isnan(stiffness):
                stiffness = hull.stiffness_nm_rad
            if math.isnan(inertia) and not self.gives("roll_period_s"):
                inertia = hull.inertia_kg_m2
        if math.isnan(inertia):
            per_rad_s = self._period_s(stiffness) / (2 * math.pi)
            inertia = stiffness * (per_rad_s * per_rad_s)  # `**` is the C library's pow
        damping, quadratic = self.damping_nms_rad, self.quadratic_damping_nms2_rad2
        if self.gives("damping_ratio"):
            damping = 2 * self.damping_ratio * math.sqrt(inertia * stiffness)
        if math.isnan(damping):
            damping = 0.0 if hull is None else hull.damping_nms_rad
            quadratic = quadratic or (0.0 if hull is None else hull.quadratic_damping_nms2_rad2)
        found = {
            "inertia_kg_m2": inertia,
            "stiffness_nm_rad": stiffness,
            "damping_nms_rad": damping,
            "quadratic_damping_nms2_rad2": quadratic,
            "displacement_n": 0.0 if math.isnan(displacement_n) else displacement_n,
        }
        own = {field.name: getattr(self, field.name) for field in fields(RollShip)}
        try:
            return RollShip(**(own | found))
        except ParameterError as error:
            problems = [(self._source(name), reason) for name, reason in error.problems]
            raise ParameterError(error.owner, problems) from error

    def _of_hull(self) -> RollShip | None:
        if self.hull is None:
            return None
        try:
            return self.hull.hull.ship()
        except (OSError, ValueError) as error:
            raise ParameterError("ship", [("hull", f"{error}; {_HULL_KEYS}")]) from error

    def _source(self, name: str) -> str:
        """Return the key that a parameter of the ship was computed from."""
        for own, other in _PAIRS:
            if name == other and self.gives(own):
                return own
        return name

    @property
    def _displacement_n(self) -> float:
        given = self.gives("displacement_t")
        return 1e3 * GRAVITY_M_S2 * self.displacement_t if given else self.displacement_n

    def _period_s(self, stiffness_nm_rad: float) -> float:
        if self.gives("roll_period_s"):
            return self.roll_period_s
        gm_m = stiffness_nm_rad / self._displacement_n
        period_s = weather_criterion_period_s(self.beam_m, self.draught_m, self.length_m, gm_m)
        if not period_s > 0:
            reason = "is beyond the weather criterion's formula: give roll_period_s"
            refuse("ship", [("length_m", reason)])
        return period_s

    def _form_problems(self) -> list[Problem]:
        """Return a displacement that the hull's length, beam and draught can't hold."""
        if not all(self.gives(name) for name in ("beam_m", "draught_m", "length_m")):
            return []
        box_t = _SEA_WATER_T_M3 * self.length_m * self.beam_m * self.draught_m
        block = self._displacement_n / (1e3 * GRAVITY_M_S2 * box_t)
        if math.isnan(block) or block == 0 or _BLOCK[0] <= block <= _BLOCK[1]:
            return []
        key = "displacement_t" if self.gives("displacement_t") else "displacement_n"
        reason = (
            f"gives a block coefficient of {block:.3g} with length_m {self.length_m:g}, beam_m "
            f"{self.beam_m:g} and draught_m {self.draught_m:g}; hulls have 0.35 to 0.9"
        )
        return [(key, reason)]

    def _missing(self) -> list[Problem]:
        problems: list[Problem] = []
        if self.hull is not None:
            return problems
        weighed = self.gives("displacement_t") or self.displacement_n > 0
        if not (self.gives("gm_m") or self.gives("stiffness_nm_rad")):
            name, other = "stiffness_nm_rad", "displacement_t and gm_m"
            if weighed:
                name, other = "gm_m", "stiffness_nm_rad"
            problems.append((name, f"is required but missing, or else {other}"))
        elif self.gives("gm_m") and not weighed:
            problems.append(("displacement_t", "is required with gm_m but missing"))
        if self.period_by_formula:
            hull = [name for name in ("beam_m", "draught_m", "length_m") if not self.gives(name)]
            if len(hull) == 3:
                reason = (
                    "is required but missing, or else roll_period_s, or else beam_m, draught_m and "
                    "length_m for the weather criterion's period"
                )
                problems.append(("inertia_kg_m2", reason))
            else:
                reason = "is required but missing for the roll period, or else roll_period_s"
                problems += [(name, reason) for name in hull]
                if not weighed and not self.gives("gm_m"):
                    reason = "is required with beam_m but missing, or else roll_period_s"
                    problems.append(("displacement_t", reason))
        return problems


def hull_words(hull: HullFile, written: frozenset[str]) -> list[str]:
    """Return what of a ship comes from its hull data, what was given, and what the data lack."""
    ship = hull.hull.ship()
    period_s = 2 * math.pi / ship.natural_frequency_rad_s
    ratio = ship.damping_nms_rad * ship.natural_frequency_rad_s / (2 * ship.stiffness_nm_rad)
    figures = (
        f"displacement {ship.displacement_n / (1e3 * GRAVITY_M_S2):.4g} t",
        f"GM {ship.stiffness_nm_rad / ship.displacement_n:.3g} m",
        f"roll period {period_s:.4g} s",
        f"damping ratio {ratio:.2g}",
    )
    taken = [
        figure
        for figure, keys in zip(figures, _PAIRS, strict=True)
        if not written.intersection(keys)
    ]
    given = [key for keys in _PAIRS for key in keys if key in written]
    words = f"ship: of {hull.file}: {', '.join(taken) or 'nothing'}"
    words += f"; given: {', '.join(given)}" if given else ""
    damped = not written.isdisjoint(_PAIRS[3])
    notes = [each for each in hull.hull.data.notes if not (damped and "viscous" in each)]
    return [words, *(f"ship: {hull.file}: {note}" for note in notes)]


def in_written_key(problem: Problem, written: Collection[str]) -> Problem:
    """Return a problem by a key of a vessel at the key that is `written` in its ship's file."""
    name, reason = problem
    section, _, key = name.partition(".")
    weight = key == "displacement"  # The weight has one of two keys.
    if weight:
        key, name = "displacement_n", "ship.displacement_n"
    if section != "ship" or key in written:
        return name, reason
    if key == "displacement_n" and "gm_m" in written and not weight:
        key = "stiffness_nm_rad"  # The radius of gyration is that of GM and period, at any weight.
    by_formula = "beam_m" if key == "inertia_kg_m2" else key
    own = next((own for own, other in _PAIRS if other == key and own in written), by_formula)
    if own not in _UNITS:
        return name, reason
    return f"ship.{own}", f"{reason.partition(': ')[0]}: {_UNITS[own]}"


def _as_ship(value: Any, written: Callable[[Any], WrittenShip]) -> RollShip:
    return value if type(value) is RollShip else written(value).ship()


if TYPE_CHECKING:
    ShipFromFile = RollShip
else:
    ShipFromFile = Annotated[WrittenShip, WrapValidator(_as_ship), PlainSerializer(asdict)]
