"""A tank in a turn, and beside fins and a rudder: heel, wave slope that each holds, yaw moment.

    python -m tools.studies.turning --json

Ships of `tools.studies.ten_hulls` with tank and pump of `init`, by statics and published formulas:
height of the metacentre by Morrish and D'Arcangelo, lift slope of fin and rudder by Whicker and
Fehlner (1958). A turn has a diameter of four lengths. The tank's yaw moment is that of its water's
side force at the usable level and the roll period, a tenth of the length off amidships.
"""

import math
from typing import Any, Final

import numpy as np

from firmware_sim.starter import StarterShip, make_starter
from tools.printing import command_line, show
from tools.studies.ten_hulls import SHIPS
from utank_hil.analysis.tank_sizing import TankRoom, usable_level_m, wave_slope_capacity_rad
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.tank import GRAVITY_M_S2

G: Final = GRAVITY_M_S2
SEA_KG_M3: Final = 1025.0
NAMES: Final = ("patrol vessel, 63 m", "supply vessel, 80 m", "ferry, 180 m",
                "container ship, 330 m")  # fmt: skip
KNOTS: Final = (0.0, 6.0, 12.0, 18.0)
TURN_KNOTS: Final = 12.0
DIAMETER: Final = 4.0  #: Of the turn, in lengths.
FIN_AREA: Final = 0.007  #: Of each of two fins, as a share of length times draught.
RUDDER_AREA: Final = 1 / 55  #: Likewise of the rudder.
FIN_RAD: Final = math.radians(20)  #: Angle before it stalls.
RUDDER_RAD: Final = math.radians(10)  #: Angle that leaves the course to be kept.
OFF_AMIDSHIPS: Final = 0.1  #: Of the length.


def lift_slope(aspect: float) -> float:
    """Lift per angle in rad of a foil without sweep, of an effective aspect ratio."""
    return 1.8 * math.pi * aspect / (math.sqrt(aspect**2 + 4) + 1.8)


def above_keel_m(length: float, beam: float, draught: float, mass_kg: float, gm: float) -> float:
    """Height of the centre of gravity above the keel, by that of the metacentre."""
    volume = mass_kg / SEA_KG_M3
    block = volume / (length * beam * draught)
    waterplane = block / (0.471 + 0.551 * block)
    buoyancy = draught * (5 / 6 - block / (3 * waterplane))
    radius = (0.1216 * waterplane - 0.0410) * length * beam**3 / volume
    return buoyancy + radius - gm


def figures(name: str) -> dict[str, Any]:
    """Heel in the turn, slope that each device holds, and yaw moments of one ship."""
    length, beam, draught, displacement, gm, period = SHIPS[name]
    particulars = StarterShip(name, length, beam, displacement, gm, period, draught)
    vessel = make_starter(particulars, TankRoom.in_hull(length, beam)).vessel
    ship, tank, mass_kg = vessel.ship, vessel.tank, 1e3 * displacement
    level, most_pa = usable_level_m(ship, tank), vessel.default_limits["pressure_pa"]
    keel = above_keel_m(length, beam, draught, mass_kg, gm)

    def inward(speed_kn: float) -> float:
        return (speed_kn * 0.5144) ** 2 / (DIAMETER / 2 * length)

    acceleration = inward(TURN_KNOTS)
    moment = mass_kg * acceleration * (keel - draught / 2)
    _, _, stiffness = coupled_matrices(ship, tank)
    tilt = np.array([0.0, stiffness[1, 0] * acceleration / G])
    passive, _ = np.linalg.solve(stiffness, np.array([moment, 0.0]) - tilt)
    pressed = np.array([moment, -most_pa * tank.reservoir_area_m2]) - tilt
    active, there = np.linalg.solve(stiffness, pressed)
    if abs(there) > level:  # the level's limit comes before the pump's
        active = (moment - stiffness[0, 1] * math.copysign(level, there)) / stiffness[0, 0]
    arms = {
        # two fins at the bilge, a rudder below the centre of gravity
        "fins": (2 * FIN_AREA * length * draught, FIN_RAD, lift_slope(2.0),
                 0.9 * math.hypot(beam / 2, keel)),
        "rudder": (RUDDER_AREA * length * draught, RUDDER_RAD, lift_slope(3.0),
                   keel - draught / 2),
    }  # fmt: skip
    righting = mass_kg * G * gm

    def lift(device: str, speed_kn: float) -> float:
        area, angle, slope, _ = arms[device]
        return SEA_KG_M3 / 2 * (speed_kn * 0.5144) ** 2 * area * slope * angle

    roll_rad_s = ship.natural_frequency_rad_s
    side = tank.density_kg_m3 * tank.reservoir_area_m2 * tank.width_m * roll_rad_s**2 * level
    return {
        "heel_in_turn_deg": {
            "no tank": math.degrees(moment / ship.stiffness_nm_rad),
            "passive": math.degrees(passive),
            "pump": math.degrees(active),
        },
        "slope_held_deg": {
            "tank": math.degrees(wave_slope_capacity_rad(ship, tank, level)),
            **{
                f"{device}, {speed:g} kn": math.degrees(lift(device, speed) * arms[device][3])
                / righting
                for device in arms
                for speed in KNOTS[1:]
            },
        },
        "yaw_of_rudder": side * OFF_AMIDSHIPS / (lift("rudder", TURN_KNOTS) / 2),
    }


def main() -> None:
    """Compute and print."""
    arguments = command_line(__doc__).parse_args()
    found = {name: figures(name) for name in NAMES}
    columns = ("heel_in_turn_deg", "slope_held_deg")
    tables = {column: {name: each[column] for name, each in found.items()} for column in columns}
    yaw = {name: {"tank per rudder": each["yaw_of_rudder"]} for name, each in found.items()}
    show({**tables, "yaw moment": yaw}, arguments)


if __name__ == "__main__":
    main()
