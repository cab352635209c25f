"""One check of a commissioning, and the zeros of the sensors while ship and water are at rest.

What the pump's pulses show: signs, scales and order of sensors and pump, and natural periods.

Three equations, low-pass filtered on both sides (`filtered`), are solved by least squares, that of
the tank with instrumental variables (`utank_hil.nodes.commissioning.precision`). With the level h,
the roll phi, the pressure P and the notation of `utank_hil.dynamics.linear`::

    pump   P = a P_promised                                   by command, delay and lag
    tank   P / rho = Le h'' + c h' + k h - r (g L phi + L (H + Lz) phi'') + q |h'| h'   either gauge
    ship   -(M01 h'' + K01 h) = M00 phi'' + B00 phi' + K00 phi

By hydrostatics k is 2 g and r is 1, whatever friction and load are. So 2 g / k is a gauge's scale
with its sign, r that of the roll, and sqrt(k / Le) the tank's frequency. M00 and K00 less the
water's share are the ship's inertia and stiffness. The ship's equation is solved with the scales
taken out, so that a wrong one shows in its own check alone.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import TICK_S
from utank_hil.control.interface import DesignPlant
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.nodes.commissioning import precision
from utank_hil.nodes.commissioning.pulses import PulsePlan, ValveStroke
from utank_hil.nodes.commissioning.remedies import Each, remedies_of
from utank_hil.safety.monitors.thresholds import ZERO_HEEL_DEG
from utank_hil.safety.situation import VALVE_OFF

ROLL_ZERO_DEG: Final = 1.0
RATE_ZERO_DEG_S: Final = 0.03
"""The monitors learn so much; twice as much would be DRIFT for good, and arming refused."""
PRESSURE_ZERO: Final = 0.02
"""Share of the pressure limit."""
WATER_HEEL_DEG: Final = ZERO_HEEL_DEG * 2 / 3
"""The monitors bear half as much again."""

STILL: Final = 0.2
"""Share of the plan's peaks: ship and water that move more by themselves hide what pulses do."""


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that was checked."""

    name: str  #: For programs, as in the record.
    what: str  #: For people.
    #: measured, expected, tolerance: in `unit`; NaN could not be measured, and fails.
    measured: float
    expected: float
    tolerance: float
    unit: str
    remedy: str  #: What to do if it failed.

    @property
    def passed(self) -> bool:
        """Whether it is within its tolerance."""
        return abs(self.measured - self.expected) <= self.tolerance


SETTLED_S: Final = 0.5  #: After a stop the rotor turns with the water that it has moved.
STOPPED: Final = 0.1  #: Of the fall until then.
PRESSED: Final = 0.2  #: Likewise of a pressure, whose sensor is noisy.
AT_REST: Final = 5  #: Ticks for which it must stay there: a noisy sensor is not always.
RUNS_ON: Final = 0.5  #: Of what it was before: no stop. The water turned it at 0.2 on the bench.


def stopped_ms(shares: Sequence[float], share: float = STOPPED) -> float:
    """Time in ms that a pump takes to stop; NaN if it runs on.

    `shares`, one each tick from the stop on, are of the speed or pressure before; it has stopped
    with so small a `share` of the fall left, and not while it drives the other way.
    """
    last = shares[-AT_REST:]
    end = math.fsum(last) / max(len(last), 1)
    if not (last and abs(end) <= RUNS_ON):
        return math.nan
    low = [-RUNS_ON <= each <= end + share * (1 - end) for each in shares]
    rests = (at for at in range(len(low) - AT_REST + 1) if all(low[at : at + AT_REST]))
    return next(rests, math.nan) * TICK_S * 1e3


def judge_rest(
    rest: precision.Record, plant: DesignPlant, plan: PulsePlan | None, volume_m: float
) -> list[Check]:
    """Zeros of the sensors, and whether ship and water are still enough for pulses.

    `rest` is the record of some seconds in which ship and water are at rest and the pump is off.
    `plan` is None for a tank without a pump. `volume_m` is the sum of both levels at which the
    volume's monitor speaks.
    """
    mean = {name: float(column.mean()) for name, column in rest.items()}
    roll_deg = math.degrees(mean["roll_rad"])
    # the water's surface stays level, but for what the pressure sensor says of a pump that is off
    width_m, density_kg_m3 = plant.tank.width_m, plant.tank.density_kg_m3
    starboard_m = math.tan(mean["roll_rad"]) * width_m / 2
    higher_m = mean["starboard_level_m"] - mean["port_level_m"]
    higher_m -= mean.get("pressure_pa", 0.0) / (density_kg_m3 * GRAVITY_M_S2)
    heel_deg = math.degrees(math.atan(higher_m / width_m))
    checks = [
        Check("roll_zero", "roll at rest", roll_deg, 0.0, ROLL_ZERO_DEG, "deg",
              "Trim the ship upright, or mount the motion sensor level."),
        _rate_zero("roll_rate_zero", "roll rate at rest", mean["roll_rate_rad_s"]),
        _gauge_zero("port", mean["port_level_m"], -starboard_m, volume_m / 2),
        _gauge_zero("starboard", mean["starboard_level_m"], starboard_m, volume_m / 2),
        Check("high_level_switches", "high-level switches open, share", 1 - mean["high_level"],
              1.0, 0.0, "1", "Check the switches and their wiring: low water leaves both open."),
    ]  # fmt: skip
    if plan is not None:
        level_m = (rest["starboard_level_m"] - rest["port_level_m"]) / 2
        wait = "Wait for calmer water, without traffic and people moving on board."
        checks += [
            Check("roll_still", "roll about its mean, RMS", math.degrees(rest["roll_rad"].std()),
                  0.0, STILL * math.degrees(plan.roll_rad), "deg", wait),
            Check("level_still", "level about its mean, RMS", float(level_m.std()), 0.0,
                  STILL * plan.level_m, "m", wait),
        ]  # fmt: skip
        noise = math.sqrt(precision.times_needed(rest, plan.of_noise) / plan.most_times)
        checks.append(
            Check("noise", "noise at rest, by what pulses average", noise, 0.0, 1.0,
                  "1", "Take gauges and a pressure sensor with less noise by this factor, "
                  "or filter it where it is measured.")
        )  # fmt: skip
        limit_kpa = plant.limits.pressure_pa * 1e-3
        checks.append(
            Check("pressure_zero", "pump pressure at rest", mean["pressure_pa"] * 1e-3, 0.0,
                  PRESSURE_ZERO * limit_kpa, "kPa",
                  "Set the pressure sensor's zero; both its sides are to be full of water.")
        )  # fmt: skip
    checks.append(
        Check("water_heel", "heel by levels and pressure, less roll", heel_deg - roll_deg, 0.0,
              WATER_HEEL_DEG, "deg", "Set the zeros of motion sensor, gauges and pressure sensor.")
    )  # fmt: skip
    if "roll_2_rad" in rest:
        apart_deg = math.degrees(mean["roll_2_rad"]) - roll_deg
        checks += [
            Check("roll_2_zero", "second sensor's roll less the first's", apart_deg, 0.0,
                  ROLL_ZERO_DEG / 2, "deg", "Mount both motion sensors level."),
            _rate_zero("roll_rate_2_zero", "second sensor's rate", mean["roll_rate_2_rad_s"]),
        ]  # fmt: skip
    return checks


def judge_valve(opening: FloatArray, stroke: ValveStroke, sample_time_s: float) -> list[Check]:
    """Whether the valve went where it was commanded, by its measured opening during the stroke."""
    there = round(stroke.hold_s / sample_time_s) - 1
    remedy = "Check the valve's drive, and the order of open and shut of its position sensor."
    return [
        Check("valve_narrow", "valve narrow", float(opening[there]), stroke.opening,
              VALVE_OFF, "1", remedy),
        Check("valve_open", "valve open", float(opening[-1]), 1.0, VALVE_OFF, "1", remedy),
    ]  # fmt: skip


def _rate_zero(name: str, what: str, rate_rad_s: float) -> Check:
    remedy = "Wait until the ship is still; set the zero of the gyroscope."
    return Check(name, what, math.degrees(rate_rad_s), 0.0, RATE_ZERO_DEG_S, "deg/s", remedy)


def _gauge_zero(side: str, measured_m: float, expected_m: float, tolerance_m: float) -> Check:
    return Check(
        f"{side}_level_zero", f"{side} gauge at rest", measured_m, expected_m, tolerance_m, "m",
        f"Set the {side} gauge's zero at the still-water level; check the tank's filling.",
    )  # fmt: skip


RATE_SCALE: Final = 0.03
"""At sea the monitors bear it, and not 4 % (Patti-B); at the quay it is found to 1 %."""
ROLL_2_SCALE: Final = 0.05
"""Two sensors that are farther apart disagree at sea: half a degree at a roll of ten."""
TANK_PERIOD: Final = 0.1
ROLL_PERIOD: Final = 0.15
"""Tolerances, as shares."""
STILL_SHARE: Final = 0.1
"""Of the plan's peak, after the filter, which lets two thirds through: less is no motion."""

_BEND, _RATE, _VALUE = range(3)  # rows of a filtered signal


_SCALES: Final = (
    ("pressure", "pump pressure, by the command", precision.SCALE),
    ("port_level", "port level, by the pump pressure", precision.SCALE),
    ("starboard_level", "starboard level, by the pump pressure", precision.SCALE),
    ("roll", "roll, by what it does to the water", precision.ROLL_SCALE),
    ("roll_rate", "roll rate, by the roll", RATE_SCALE),
)  #: Check, what is judged, and tolerance of each scale.


def judge_pulses(
    rest: precision.Record,
    pulses: precision.Record,
    plant: DesignPlant,
    plan: PulsePlan,
    sample_time_s: float,
    of_derived: Sequence[str] = ("", ""),
) -> list[Check]:
    """Judge the records at rest, and from the moment at which the first pulse began.

    `plant` is as the files describe it, `plan` what was to be done, `sample_time_s` the time
    between two rows. `of_derived` is what to do about the rate of each motion sensor if it is
    derived of the roll; else it is empty.
    """

    def moved(name: str) -> FloatArray:
        return precision.filtered(pulses[name] - rest[name].mean(), plant, sample_time_s)

    roll, rate, pressure = map(moved, ("roll_rad", "roll_rate_rad_s", "pressure_pa"))
    port, starboard = -moved("port_level_m"), moved("starboard_level_m")
    promised_pa = _promised(pulses["command_pa"], plant, sample_time_s)
    promised = precision.filtered(promised_pa, plant, sample_time_s)
    push = precision.push_of(roll, plant)
    known = precision.instruments(pulses["command_pa"], plant, sample_time_s)
    of_tank, of_roll = known[:5], known[5:]
    pushed = pressure[_VALUE] / plant.tank.density_kg_m3
    # a pressure of nothing but zero fits any water: there is then no equation
    fits = [
        _least_squares(list((of_tank @ precision.columns_of(gauge, push).T).T), of_tank @ pushed)
        if _moves(gauge, plan.level_m) and pushed.any()
        else None
        for gauge in (port, starboard)
    ]
    gauges = [0.0 if fit is None else 2 * GRAVITY_M_S2 / float(fit[_VALUE]) for fit in fits]
    good = [fit for fit in fits if fit is not None]
    rolls = _moves(roll, plan.roll_rad)
    scales = Each(
        _slope(pressure[_VALUE], promised[_VALUE], promised[_VALUE]),
        gauges[0],
        gauges[1],
        _mean([float(fit[3]) for fit in good]) if rolls else 0.0,
        _slope(rate[_VALUE], roll[_RATE], of_roll[_RATE]) if rolls else 0.0,
    )
    checks = [
        _scale_check(name, what, scale, tolerance, remedy)
        for (name, what, tolerance), scale, remedy in zip(
            _SCALES, scales, remedies_of(scales, of_derived[0]), strict=True
        )
    ]
    if "roll_2_rad" in pulses:
        motion_2 = moved("roll_2_rad"), moved("roll_rate_2_rad_s")
        checks += _second_sensor(*motion_2, roll, of_roll, of_derived[1])
    tank_period_s = _period_s(_mean([float(fit[_VALUE] / fit[_BEND]) for fit in good]))
    ship_period_s = math.nan
    if good and rolls:
        true = [
            each / scale for each, scale in zip((port, starboard), gauges, strict=True) if scale
        ]
        true_roll = [of_roll @ each / scales.roll for each in roll]
        ship_period_s = _ship_period_s(np.mean(true, axis=0), true_roll, of_roll, plant)
    return [
        *checks,
        _period_check("tank_period", "natural period of the tank", tank_period_s, plan.period_s,
                      TANK_PERIOD, "Check the tank's filling and its measures in the ship's file."),
        _period_check("roll_period", "the ship's own roll period", ship_period_s,
                      2 * math.pi / plant.ship.natural_frequency_rad_s, ROLL_PERIOD,
                      "Slacken the moorings and try again; else give its roll period as loaded in "
                      "the ship's file."),
    ]  # fmt: skip


def _second_sensor(
    roll_2: FloatArray, rate_2: FloatArray, roll: FloatArray, of_roll: FloatArray, of_derived: str
) -> list[Check]:
    of_first = _slope(roll_2[_VALUE], roll[_VALUE], of_roll[_VALUE])
    of_itself = _slope(rate_2[_VALUE], roll_2[_RATE], of_roll[_RATE])
    remedy = "Mount both motion sensors alike: roll is positive starboard down."
    return [
        _scale_check("roll_2", "second sensor's roll, by the first's",
                     of_first, ROLL_2_SCALE, remedy),
        _scale_check("roll_rate_2", "second sensor's rate, by its roll",
                     of_itself, RATE_SCALE, of_derived or remedy),
    ]  # fmt: skip


def _ship_period_s(
    level: FloatArray, roll: list[FloatArray], of_roll: FloatArray, plant: DesignPlant
) -> float:
    """Period of the ship alone, by how it answers the water; NaN if it finds none."""
    mass, _, stiffness = coupled_matrices(plant.ship, plant.tank)
    righting = -(mass[0, 1] * level[_BEND] + stiffness[0, 1] * level[_VALUE])
    inertia, _, righted = _least_squares(roll, of_roll @ righting).tolist()
    # less the water's share
    inertia -= mass[0, 0] - plant.ship.inertia_kg_m2
    righted -= stiffness[0, 0] - plant.ship.stiffness_nm_rad
    return _period_s(righted / inertia)


def _scale_check(name: str, what: str, scale: float, tolerance: float, remedy: str) -> Check:
    return Check(name, what, scale, 1.0, tolerance, "1", remedy)


def _period_check(
    name: str, what: str, period_s: float, expected_s: float, share: float, remedy: str
) -> Check:
    return Check(name, what, period_s, expected_s, share * expected_s, "s", remedy)


def _mean(values: list[float]) -> float:
    return sum(values) / len(values) if values else math.nan


def _period_s(square_rad2_s2: float) -> float:
    """Period of a squared frequency; NaN where that is none."""
    return 2 * math.pi / math.sqrt(square_rad2_s2) if square_rad2_s2 > 0 else math.nan


def _promised(command_pa: FloatArray, plant: DesignPlant, sample_time_s: float) -> FloatArray:
    """The pressure that the files promise for a command."""
    late = np.roll(command_pa, round(plant.delay_s / sample_time_s))  # the record ends at zero
    share = 1 - math.exp(-sample_time_s / plant.lag_s) if plant.lag_s > 0 else 1.0
    pressure_pa = np.empty(len(late))
    value = 0.0
    for index, asked in enumerate(late.tolist()):
        value += share * (asked - value)
        pressure_pa[index] = value
    return pressure_pa


def _moves(signal: FloatArray, expected: float) -> bool:
    return bool(np.abs(signal[_VALUE]).max() > STILL_SHARE * expected)


def _slope(y: FloatArray, x: FloatArray, known: FloatArray) -> float:
    """Slope of y against x, through zero, by what is known of x."""
    power = float(known @ x)
    return float(known @ y) / power if power else math.nan


def _least_squares(columns: list[FloatArray], y: FloatArray) -> FloatArray:
    matrix = np.column_stack(columns)
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0] = 1.0
    return np.asarray(np.linalg.lstsq(matrix / size, y, rcond=None)[0] / size)
