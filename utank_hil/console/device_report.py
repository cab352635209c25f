"""What ``utank-hil check`` says of the devices: what each promises, what protects it, what not."""

from typing import Any

from utank_hil.configuration.device_sections import unit_of
from utank_hil.configuration.devices import DeviceSection, DevicesSection
from utank_hil.console.terminal import Terminal

_UNITS = {"rad": "rad", "rad_s": "rad/s", "m": "m", "pa": "Pa", "m3_s": "m³/s"}


def devices_json(devices: DevicesSection | None) -> dict[str, Any]:
    """Devices by their roles; those that are native nodes are left out."""
    sensors = {} if devices is None else devices.sensors()
    return {role: _figures(each) for role, each in sensors.items() if not each.native}


def _figures(device: DeviceSection) -> dict[str, Any]:
    has, lacks = _protection(device)
    return {
        "profile": device.profile,
        "device": device.device or device.profile,
        "documents": device.documents,
        "bus": device.bus,
        "rate_hz": 1e3 / device.period_ms(),
        "latency_ms": device.latency_ms,
        "age_ms": device.age_ms,
        "steps": {name: device.step(name) for name in device.signals},
        "derived": [name for name, each in device.signals.items() if each.source == "derived"],
        "protected_by": has,
        "not_protected_by": lacks,
    }


def _protection(device: DeviceSection) -> tuple[list[str], list[str]]:
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
        "identity": guards.n2k_name is not None,
    }
    has = [name for name, given in there.items() if given]
    lacks = ("counter", "checksum", "time stamp", "status", "identity")
    return ["length", "range", "cycle", *has], [name for name in lacks if not there[name]]


def print_devices(console: Terminal, devices: DevicesSection | None) -> None:
    """Print each device in a few lines."""
    for role, each in devices_json(devices).items():
        where = f" on {each['bus']}" if each["bus"] else ""
        console.say(f"{role}: {each['device']}{where}")
        console.say(f"  promises {each['rate_hz']:.3g} Hz, {each['latency_ms']:g} ms late at most")
        for name, step in each["steps"].items():
            what = f"in steps of {step:.2g} {_UNITS.get(unit_of(name), '')}".rstrip()
            what = "derived, not measured" if name in each["derived"] else what
            console.say(f"  {name}: {what}")
        console.say("  protected by " + ", ".join(each["protected_by"]))
        if each["not_protected_by"]:
            console.say(", ".join(each["not_protected_by"]), yellow="  not protected by")
    if devices is not None and devices.unprotected:
        console.say("Half the pressure is allowed until a second motion sensor agrees.")
