"""Figure 2.8: the pump rolls the ship on still water, is stopped, and the tank quiets it."""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from tools.thesis.capsize import without_tank
from tools.thesis.figure import Check, Curve, Figure, Panel, Row, Verdict
from tools.thesis.ships import (
    ROLL_RAD_S,
    StimulatedRoll,
    first_ship,
    stimulate_on_still_water,
    tuned_tank,
)
from tools.thesis.simulate import simulate
from utank_hil.analysis.motion.decay import roll_decay
from utank_hil.base.arrays import FloatArray
from utank_hil.control.optimal_tank import ship_ratios
from utank_hil.dynamics import RollModel
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank

OFF_S: Final = 141.0
PRINTED_DEG: Final = 3.0
FRICTIONS: Final = (0.08, 0.16, 0.3)
CHOSEN: Final = 0.16
_CYCLE_S: Final = math.tau / ROLL_RAD_S


def _ship(friction: float) -> tuple[RollShip, Tank]:
    ship, tank = first_ship(4.81875e7, friction)
    return ship, replace(tuned_tank(ship, tank), headroom_m=4.0)


def _stimulated(ship: RollShip, tank: Tank) -> StimulatedRoll:
    """Rolled to three degrees: the pressure is the open number, and the model nearly linear."""
    trial = stimulate_on_still_water(RollModel(ship, tank), 5e3, ROLL_RAD_S)
    pressure_pa = 5e3 * math.radians(PRINTED_DEG) / trial.stimulated_rad
    return stimulate_on_still_water(RollModel(ship, tank), pressure_pa, ROLL_RAD_S)


def figure_2_8() -> Figure:
    """Histories, phases before and after the stop, and cycles to a tenth."""
    ship, tank = _ship(CHOSEN)
    found = _stimulated(ship, tank)
    printed_duct = replace(first_ship(4.81875e7, CHOSEN)[1], headroom_m=4.0)
    cycles = {each: _stimulated(*_ship(each)).cycles_to_tenth for each in FRICTIONS}
    cycles_printed = _stimulated(ship, printed_duct).cycles_to_tenth
    time, roll, level = found.run.time_s, found.run.state[:, 0], found.run.state[:, 2]
    after = _lead_deg(time, roll, level, OFF_S, OFF_S + _CYCLE_S)
    later = _lead_deg(time, roll, level, OFF_S + _CYCLE_S, OFF_S + 2 * _CYCLE_S)
    driving = _highest(time, level, OFF_S - _CYCLE_S, OFF_S)
    dropped = _highest(time, level, OFF_S + 3, OFF_S + 9)
    risen = _highest(time, level, OFF_S + 9, OFF_S + 35)
    bare = without_tank(RollModel(ship, tank))
    free = simulate(bare, 120.0, (math.radians(PRINTED_DEG), 0.0, 0.0, 0.0))
    own = roll_decay(free.time_s, free.state[:, 0]).damping_ratio
    with_tank = math.log(10) / (math.tau * found.cycles_to_tenth)
    power_before, power_after = (
        _tank_power_w(tank, time, found.run.state, begin)
        for begin in (OFF_S - 3 * _CYCLE_S, OFF_S + 0.5 * _CYCLE_S)
    )
    return Figure(
        "nonlinear model, compiled simulation",
        "The source gives no ship, pressure or friction. Here the first ship with a duct sized for "
        "its roll frequency; the pressure is chosen for three degrees, the friction varied from "
        "0.08 to 0.3 (0.16 drawn).",
        (
            Panel(
                "",
                "Time (s)",
                "Angle (°)",
                (
                    Curve("roll", time, np.degrees(roll)),
                    Curve("tank angle", time, np.degrees(2 * level / tank.width_m)),
                ),
                span=(0.0, OFF_S),
                span_label="pump on",
            ),
        ),
        rows=(
            Row(
                "roll when the pump stops",
                "°",
                PRINTED_DEG,
                math.degrees(found.stimulated_rad),
                "pressure chosen for it",
            ),
            Row(
                "level's lead before the stop",
                "°",
                90.0,
                math.degrees(found.level_lead_rad),
                f"its roll frequency with the water is {ship_ratios(ship, tank)[1]:.3f} rad/s, "
                f"not {ROLL_RAD_S:g}",
            ),
            Row(
                "level's phase against the roll in the first cycle after",
                "°",
                180.0,
                abs(after),
                "it turns through 180° on its way to the passive tank's",
            ),
            Row(
                "cycles to a tenth of the roll, friction 0.16",
                "",
                (4.0, 5.0),
                found.cycles_to_tenth,
                "",
            ),
            *(
                Row(f"the same, friction {each:g}", "", (4.0, 5.0), cycles[each], "friction varied")
                for each in FRICTIONS
                if each != CHOSEN
            ),
            Row(
                "the same, the printed duct",
                "",
                (4.0, 5.0),
                cycles_printed,
                "the printed tank is 18 % too fast for the ship",
            ),
        ),
        checks=(
            Check(
                "the moment of the stimulator drives the ship's roll, afterwards the roll pumps "
                "the water",
                Verdict.of(power_before > 0 > power_after),
                f"mean power of the water on the ship: {power_before / 1e3:.0f} kW over the last "
                f"three cycles of the pump, {power_after / 1e3:.0f} kW after it",
            ),
            Check(
                "at the stop the water height drops considerably, and then becomes higher",
                Verdict.of(dropped < 0.7 * driving and risen > 1.1 * driving),
                f"{driving:.2f} m before, {dropped:.2f} m within the next half cycle, "
                f"{risen:.2f} m later",
            ),
            Check(
                "at the stop the level shifts to about 180° from the roll",
                Verdict.of(abs(abs(after) - 180) < 45),
                f"level against roll {math.degrees(found.level_lead_rad):.0f}° before, "
                f"{after:.0f}° over the first cycle after, {later:.0f}° over the second: it passes "
                "180° within half a cycle",
            ),
            Check(
                "the roll then leads the water",
                Verdict.of(-180 < later < 0),
                f"level against roll in the second cycle: {later:.0f}°",
            ),
            Check(
                "within four or five cycles the roll falls tenfold",
                Verdict.of(4.0 <= found.cycles_to_tenth <= 5.0),
                f"{found.cycles_to_tenth:.1f} cycles",
            ),
            Check(
                "the tank substantially increases the natural damping",
                Verdict.of(with_tank > 2 * own),
                f"damping ratio {own:.3f} without the tank; a tenfold fall in "
                f"{found.cycles_to_tenth:.1f} cycles is one of {with_tank:.3f}",
            ),
            Check("field experiments are similar", Verdict.OPEN, "no measured curve is printed"),
        ),
        columns=1,
    )


def _lead_deg(
    time: FloatArray, roll: FloatArray, level: FloatArray, begin: float, end: float
) -> float:
    """Phase lead of the level against the roll over a span."""
    shown = (time > begin) & (time <= end)
    turn = np.exp(-1j * ROLL_RAD_S * time[shown])
    return float(np.degrees(np.angle(np.sum(level[shown] * turn) / np.sum(roll[shown] * turn))))


def _highest(time: FloatArray, level: FloatArray, begin: float, end: float) -> float:
    return float(np.abs(level[(time > begin) & (time <= end)]).max())


def _tank_power_w(tank: Tank, time: FloatArray, state: FloatArray, begin: float) -> float:
    """Mean power over three cycles of the level's moment on the rolling ship."""
    shown = (time > begin) & (time <= begin + 3 * _CYCLE_S)
    roll_rate, level, level_rate = state[shown, 1], state[shown, 2], state[shown, 3]
    area = tank.density_kg_m3 * tank.reservoir_area_m2 * tank.width_m
    acceleration = np.gradient(level_rate, time[shown])
    moment = area * (GRAVITY_M_S2 * level + (tank.height_m + tank.lz_m) * acceleration)
    return float(np.mean(moment * roll_rate))
