"""What ``utank-hil check`` says of a ship and of its devices."""

import math
from typing import Any, Final

import numpy as np

from utank_hil.analysis.tank_sizing import pump_demand, pump_level_m, size_pump
from utank_hil.canbus.profiles.guarded import guard_parts
from utank_hil.configuration import Vessel
from utank_hil.configuration.device_section import DeviceSection
from utank_hil.configuration.device_sections import unit_of
from utank_hil.configuration.devices import DevicesSection, PanelSection, ValveSection
from utank_hil.configuration.plausibility import free_surface_nm_rad, holding
from utank_hil.console.terminal import Terminal, new_table, rows_table
from utank_hil.control.optimal_tank import tank_figures
from utank_hil.dynamics.linear import state_matrices
from utank_hil.dynamics.nonlinear import RollModel, steady_heel, upright
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.dynamics.valves import added_damping_ratio

_OF_PUMP: Final = (
    "pump_heel_rad", "pump_heel_at_the_end", "pump_head_m", "pump_flow_m3_s", "pump_power_asked_w",
    "pump_power_held_w", "pump_power_w",
)  # fmt: skip
_UNITS = {"rad": "rad", "rad_s": "rad/s", "m": "m", "pa": "Pa", "m3_s": "m³/s"}


def ship_json(vessel: Vessel) -> dict[str, Any]:
    """A ship as one JSON object."""
    return {
        "name": vessel.name,
        "configuration_version": vessel.version,
        **ship_figures(vessel),
        "assumptions": list(vessel.assumptions),
        "devices": devices_json(vessel.devices),
        "limits": vessel.default_limits,
    }


def ship_figures(vessel: Vessel) -> dict[str, Any]:
    """What ship, tank and pump are to each other, by the linear model.

    `modes` are the two motions of ship and water together, from slow to fast; ratios are as in
    `TankFigures`. Metacentric height and the water's share of the displacement are None where that
    is not given, what is of the pump without one: the heel that its greatest pressure holds (None
    where it capsizes the ship) and whether a reservoir is full or empty then; the flow of
    `pump_demand`, and the power of pressure and flow, without losses.
    """
    ship, tank = vessel.ship, vessel.tank
    figures = tank_figures(ship, tank)
    free = np.linalg.eigvals(state_matrices(ship, tank)[0])
    frequency = ship.natural_frequency_rad_s
    water_kg = tank.water_kg
    weight_n = ship.displacement_n or None
    return {
        "roll_period_s": 2 * math.pi / frequency,
        "tank_period_s": 2 * math.pi / tank.natural_frequency_rad_s,
        "gm_m": None if weight_n is None else ship.stiffness_nm_rad / weight_n,
        "water_kg": water_kg,
        "water_share": None if weight_n is None else water_kg * GRAVITY_M_S2 / weight_n,
        "roll_frequency_rad_s": frequency,
        "roll_damping_ratio": ship.damping_nms_rad / (2 * ship.inertia_kg_m2 * frequency),
        "tank_frequency_rad_s": tank.natural_frequency_rad_s,
        "tank_damping_ratio": tank.damping_ratio,
        "modes": [
            {
                "frequency_rad_s": abs(mode),
                "period_s": 2 * math.pi / abs(mode),
                "damping_ratio": -mode.real / abs(mode),
            }
            for mode in sorted(free.astype(complex), key=abs)
            if mode.imag >= 0
        ],
        "frequency_ratio": figures.frequency_ratio,
        "mass_ratio": figures.mass_ratio,
        "coupling_ratio": figures.coupling_ratio,
        "stability_taken": free_surface_nm_rad(ship, tank) / ship.stiffness_nm_rad,
        "level_limit_m": tank.level_limit_m,
        **_pump_figures(vessel),
        **_valve_figures(vessel),
    }


def _valve_figures(vessel: Vessel) -> dict[str, float | None]:
    """Damping ratio that the valve adds to the water at half the greatest level."""
    added: dict[str, float | None] = dict.fromkeys(("valve_damping_open", "valve_damping_shut"))
    if vessel.valve is not None:
        losses = vessel.valve.range(vessel.tank)
        for name, loss in zip(added, (losses.open_loss, losses.shut_loss), strict=True):
            half_m = vessel.tank.level_limit_m / 2
            added[name] = added_damping_ratio(vessel.tank, loss, half_m)
    return added


def _pump_figures(vessel: Vessel) -> dict[str, Any]:
    pump, tank = vessel.pump, vessel.tank
    if pump is None:
        return dict.fromkeys(_OF_PUMP)
    pressure_pa = pump.max_pressure_pa
    heel = steady_heel(upright(RollModel(vessel.ship, tank)), pressure_pa)
    flow_m3_s = pump_demand(vessel.ship, tank, pump_level_m(vessel.ship, tank)).flow_m3_s
    heel_rad, at_the_end = (None, None) if heel is None else (abs(heel.roll_rad), heel.at_the_end)
    head_m = pressure_pa / (tank.density_kg_m3 * GRAVITY_M_S2)
    powers_w = pressure_pa * flow_m3_s, holding(pump)[2], pump.max_power_w
    figures = heel_rad, at_the_end, head_m, flow_m3_s, *powers_w
    return dict(zip(_OF_PUMP, figures, strict=True))


def _pump_rows(vessel: Vessel, figures: dict[str, Any]) -> list[tuple[str, str]]:
    if vessel.pump is None:
        return [("pump", "none")]
    heel_rad = figures["pump_heel_rad"]
    held = "capsizes the ship" if heel_rad is None else f"{math.degrees(heel_rad):.2f}°"
    return [
        ("pump's greatest pressure", f"{vessel.pump.max_pressure_pa / 1e3:.1f} kPa"),
        ("  in metres of water", f"{figures['pump_head_m']:.2f} m"),
        ("heel that it holds", held),
        ("  a reservoir is then", "full or empty" if figures["pump_heel_at_the_end"] else ""),
        ("flow that `init` sizes a pump for", f"{three_digits(figures['pump_flow_m3_s'])} m³/s"),
        ("power of pressure and flow, without losses", power_words(figures["pump_power_asked_w"])),
        ("power to hold the pressure in still water", power_words(figures["pump_power_held_w"])),
        ("power of the motor", power_words(figures["pump_power_w"])),
    ]


def _valve_rows(vessel: Vessel, figures: dict[str, Any]) -> list[tuple[str, str]]:
    valve = vessel.valve
    if valve is None:
        return []
    return [
        (f"valve in the {valve.kind}, shut to open", f"{valve.opening_time_s:g} s"),
        ("  share left open when shut", f"{valve.leakage:.1%}"),
        ("  without command or power", valve.fail_position),
        (
            "  damping ratio it adds at half that level, open to shut",
            f"{figures['valve_damping_open']:.2g} to {figures['valve_damping_shut']:.2g}",
        ),
    ]


def print_ship(vessel: Vessel) -> None:
    """Print what ship, tank and pump are to each other."""
    figures = ship_figures(vessel)
    columns = ("frequency\nrad/s", "period\ns", "damping\nratio")
    table = new_table(f"{vessel.name}, linear model", *columns)
    together = "ship and water moving together"
    for text, motion, of in (
        ("roll of the ship without water", figures, "roll_"),
        ("water in the ship held still", figures, "tank_"),
        *((together, mode, "") for mode in figures["modes"]),
    ):
        frequency_rad_s, ratio = motion[f"{of}frequency_rad_s"], motion[f"{of}damping_ratio"]
        period_s = 2 * math.pi / frequency_rad_s
        table.add_row(text, f"{frequency_rad_s:.3f}", f"{period_s:.2f}", f"{ratio:.3f}")
    console = Terminal()
    console.say(f"{vessel.name}: the ship is valid.")
    console.table(table)
    share, gm_m, taken = (figures[name] for name in ("water_share", "gm_m", "stability_taken"))
    rows = (
        ("metacentric height GM", "no displacement" if gm_m is None else f"{gm_m:.2f} m"),
        ("water in the tank", tonnes(figures["water_kg"])),
        ("  of the displacement", "" if share is None else f"{share:.2%}"),
        ("water's frequency per roll frequency", f"{figures['frequency_ratio']:.3f}"),
        ("mass ratio", f"{figures['mass_ratio']:.4f}"),
        ("coupling ratio", f"{figures['coupling_ratio']:.3f}"),
        ("stability taken by the free surface", f"{taken:.1%}"),
        ("  of GM", "" if gm_m is None else f"{taken * gm_m:.3f} m"),
        ("level at which a reservoir is full or empty", f"{figures['level_limit_m']:.2f} m"),
        *_valve_rows(vessel, figures),
        *_pump_rows(vessel, figures),
    )
    console.table(rows_table(None, (row for row in rows if row[1])))
    print_devices(console, vessel.devices)
    for assumption in vessel.assumptions:
        console.say(f"Assumed: {assumption}.")


def ship_line(vessel: Vessel) -> str:
    """What the ship's numbers mean, in a line: a wrong unit shows."""
    figures = ship_figures(vessel)
    pump = "there is no pump"
    if vessel.pump is not None:
        pump = (
            f"the pump presses {figures['pump_head_m']:.2g} m of water, at "
            f"{three_digits(figures['pump_flow_m3_s'])} m³/s with "
            f"{power_words(figures['pump_power_w'])}"
        )
    if vessel.valve is not None:
        pump += f"; a valve in the {vessel.valve.kind} opens in {vessel.valve.opening_time_s:g} s"
    periods = " and ".join(f"{mode['period_s']:.3g}" for mode in figures["modes"])
    return (
        f"The ship rolls in {figures['roll_period_s']:.3g} s, with the water in {periods} s; "
        f"{tonnes(figures['water_kg'])} of water take {figures['stability_taken']:.1%} of its "
        f"stability; {pump}."
    )


def three_digits(value: float) -> str:
    """A figure of three digits at least, without an exponent."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"


def tonnes(mass_kg: float) -> str:
    """A mass in tonnes."""
    return f"{three_digits(mass_kg / 1e3)} t"


def order_words(vessel: Vessel) -> str:
    """Return net head, flow, shaft power and duty of a vessel's pump, to order it by."""
    figures = _pump_figures(vessel)
    return (
        f"{figures['pump_head_m']:.2f} m, {three_digits(figures['pump_flow_m3_s'])} m³/s, "
        f"{power_words(figures['pump_power_w'])}, reversing"
    )


def sized_words(vessel: Vessel) -> str:
    """Return the words and the keys of the pump that `init` sizes for a tank without one."""
    demand = pump_demand(vessel.ship, vessel.tank, pump_level_m(vessel.ship, vessel.tank))
    pump = size_pump(vessel.tank, demand)
    most = f"{float(f'{pump.max_pressure_pa:.4g}'):.0f}", f"{float(f'{pump.max_power_w:.4g}'):.0f}"
    order = order_words(vessel.model_copy(update={"pump": pump}))
    keys = "pump: {{max_pressure_pa: {}, max_power_w: {}}}".format(*most)
    return f"no pump; `init` sizes for this tank: {order}\n  {keys}"


def power_words(power_w: float) -> str:
    """A power with the unit that suits it."""
    mega = abs(power_w) >= 1e6
    return f"{power_w / 1e6:.2f} MW" if mega else f"{three_digits(power_w / 1e3)} kW"


def devices_json(devices: DevicesSection | None) -> dict[str, Any]:
    """Devices by their roles; those that are native nodes are left out."""
    others = {} if devices is None else devices.devices()
    found = {
        role: _figures(each, silent=devices is not None and each.bus in devices.receive_only)
        for role, each in others.items()
        if not each.native
    }
    if devices is not None and not devices.pump.native:
        margins = devices.pressure_margins()
        found["pump"] = devices.pump.model_dump(mode="json") | {
            "loop_crossover_rad_s": margins.crossover_rad_s,
            "loop_phase_margin_deg": math.degrees(margins.phase_rad),
            "loop_gain_margin": margins.gain,
        }
    return found


def _figures(device: DeviceSection, *, silent: bool) -> dict[str, Any]:
    read_back = device.canopen_profile is not None and not silent
    has, lacks = _protection(device, read_back=read_back)
    told = {}
    if isinstance(device, ValveSection):
        told = {"commands": {name: each.to for name, each in device.commands.items()}}
        (has if read_back else lacks).append("watch on the controller's heartbeat")
        lacks.append("echo of the command")
    if isinstance(device, PanelSection):
        authenticated = device.authentication is not None
        (has if authenticated else lacks).append("authentication of arm (AES-CMAC, a challenge)")
    return {
        **told,
        "profile": device.profile,
        "device": device.device or device.profile,
        "documents": device.documents,
        "bus": device.bus,
        "rate_hz": 1e3 / device.period_ms(),
        "latency_ms": device.latency_ms,
        "age_ms": device.age_ms,
        "steps": {name: device.step(name) for name in device.signals},
        "derived": [name for name, each in device.signals.items() if each.source == "derived"],
        "read_back": device.read_back() if read_back else [],
        "protected_by": has,
        "not_protected_by": lacks,
    }


def _protection(device: DeviceSection, *, read_back: bool) -> tuple[list[str], list[str]]:
    guards = device.protection
    there = {
        "counter": bool(guards.counters),
        "checksum": bool(guards.crcs),
        "time stamp": bool(guards.stamps),
        "status": bool(device.valid_when),
        "codes for not available": any(
            layout.most_raw is not None or layout.least_raw is not None
            for message in device.messages.values()
            for layout in message.signals.values()
        ),
        f"limit on unchanged content ({guards.unchanged_ms or 0:g} ms)": bool(guards.unchanged_ms),
        "identity": guards.n2k_name is not None or (read_back and bool(device.identity)),
    }
    has = [name for name, given in there.items() if given]
    lacks = ("counter", "checksum", "time stamp", "status", "identity")
    return ["length", "range", "cycle", *has], [name for name in lacks if not there[name]]


def print_devices(console: Terminal, devices: DevicesSection | None) -> None:
    """Print each device in a few lines."""
    for role, each in devices_json(devices).items():
        where = f" on {each['bus']}" if each["bus"] else ""
        if role == "pump":
            _print_drive(console, each, where)
            continue
        console.say(f"{role}: {each['device']}{where}")
        console.say(f"  promises {each['rate_hz']:.3g} Hz, {each['latency_ms']:g} ms late at most")
        for name, step in each["steps"].items():
            what = f"in steps of {step:.2g} {_UNITS.get(unit_of(name), '')}".rstrip()
            what = "on or off" if step == 1 and not unit_of(name) else what
            what = "derived, not measured" if name in each["derived"] else what
            console.say(f"  {name}: {what}")
        for name, signal in each.get("commands", {}).items():
            console.say(f"  {name}: told by {signal} each 20 ms")
        if each["read_back"]:
            console.say("  read back by SDO before it counts: " + ", ".join(each["read_back"]))
        else:
            console.say("its settings", yellow="  not read back:")
        console.say("  protected by " + ", ".join(each["protected_by"]))
        if each["not_protected_by"]:
            console.say(", ".join(each["not_protected_by"]), yellow="  not protected by")
    if devices is not None and devices.unprotected:
        console.say("Half the pressure is allowed until a second motion sensor agrees.")
    if devices is not None:
        try:
            guard_parts(devices.foreign())
        except ValueError as error:
            console.say(f"{error}.")


def _print_drive(console: Terminal, drive: dict[str, Any], where: str) -> None:
    console.say(f"pump: {drive['profile']}, node {drive['node']}, {drive['mode']}{where}")
    required = (f"{key} {value}" for key, value in drive["require"].items() if value is not None)
    console.say("  written and read back before arming: " + ", ".join(required))
    known = any(each is not None for each in drive["identity"])
    console.say(
        f"  protected by heartbeats of {drive['heartbeat_ms']} ms both ways, echo of the "
        f"{drive['echo']}, mode" + (", identity" if known else "")
    )
    if not known:
        console.say("identity, counter, checksum", yellow="  not protected by")
    console.say(
        f"  pressure loop: {drive['loop_crossover_rad_s']:.3g} rad/s, margins "
        f"{drive['loop_phase_margin_deg']:.0f} degrees and {drive['loop_gain_margin']:.2g}"
    )
