"""A ship with devices of other makers alone, and both guards that hear their frames."""

from collections.abc import Collection
from functools import cache
from pathlib import Path
from typing import Any

from bought_devices import LEVELS, SBG
from guard_in_c import GuardInC

from firmware_sim.guard.parameters import guard_parameters
from firmware_sim.guard.reference import Guard
from firmware_sim.scenario import Scenario
from utank_hil.canbus import (
    Frame,
    HardwiredInputs,
    Quality,
    Switch,
    load_catalogue,
)
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
from utank_hil.canbus.profiles.device_plan import MessageEncoder
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.configuration.devices import DevicesSection
from utank_hil.nodes.redundancy import Redundancy

J1939 = {"profile": "j1939_ssi2", "source": 0x20, "accept_unprotected": True}
PUMP = {
    "profile": "cia402", "bus": "can2", "node": 5, "mode": "torque", "pressure_pa_per_unit": 80,
    "speed_rad_s_per_unit": 0.001,
}  # fmt: skip
SENSOR = {
    "profile": "", "bus": "can3", "accept_unprotected": True, "cycle_ms": 20, "age_ms": 100,
    "messages": {"p": {"id": 0x77, "bytes": 5, "signals": {
        "P": {"start": 7, "bits": 24, "big_endian": True, "signed": True, "unit": "Pa"},
        "COUNT": {"start": 24, "bits": 4},
    }}},
    "signals": {"pressure_pa": {"from": "p.P", "sign": -1}},
    "protection": {
        "counters": ["p.COUNT"], "crcs": [{"message": "p", "byte": 4, "polynomial": 0x2F}],
    },
}  # fmt: skip
PANEL = {
    "profile": "", "bus": "can3", "accept_unprotected": True, "cycle_ms": 100, "age_ms": 400,
    "messages": {
        "keys": {"id": 0x70, "bytes": 2, "signals": {
            name: {"start": place, "bits": 1} for place, name in
            enumerate(("ARM", "STOP", "RESET", "SEEN", "LIFE"))
        }},
    },
    "signals": {"arm": {"from": "keys.ARM"}, "stop": {"from": "keys.STOP"},
                "reset": {"from": "keys.RESET"}, "acknowledge": {"from": "keys.SEEN"}},
    "protection": {"counters": ["keys.LIFE"]},
}  # fmt: skip
ALL = {
    "motion": SBG, "motion_2": J1939, "levels": LEVELS, "pump_sensor": SENSOR, "pump": PUMP,
    "panel": PANEL,
}  # fmt: skip


def scenario_of(devices: dict[str, Any], *, guard: bool = True) -> Scenario:
    """The storm, with a ship that has these devices and two motion sensors."""
    scenario = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
    redundancy = Redundancy(second_motion_sensor=True, hardwired_inputs=True)
    changed = {"devices": DevicesSection(**devices), "redundancy": redundancy}
    vessel = scenario.vessel.model_copy(update=changed)
    config = scenario.controllers["gpc"].model_copy(update={"vessel": vessel})
    changed = {"vessel": vessel, "guard": guard, "controllers": {"gpc": config}}
    return scenario.model_copy(update=changed)


@cache
def config_of_all() -> ControllerConfig:
    return config_of(ALL)


def config_of(devices: dict[str, Any]) -> ControllerConfig:
    return scenario_of(devices).controllers["gpc"]


SOUND: dict[str, list[float]] = {
    "motion": [0.0, 0.0],
    "motion_2": [0.0, 0.0],
    "levels": [0.0, 0.0, 0.0, 0.0],
    "pump_sensor": [0.0, 0.0],
    "panel": [0.0, 0.0, 0.0, 0.0, 0.0],
}
NOISE = {"motion": 1e-3, "motion_2": 1e-3, "levels": 2e-3, "pump_sensor": 10.0, "panel": 0.0}
RELEASED, ENABLE, QUICK_STOP = 0x06, 0x0F, 0x02


class DeviceBench:
    """Both guards, which are to agree, and what the devices send to them."""

    def __init__(self, folder: Path) -> None:
        config = config_of_all()
        self.foreign = config.vessel.foreign
        self.table = guard_parameters(config)
        self.guards = Guard(self.table), GuardInC(self.table, folder)
        self.guards[1].agrees(self.guards[0])
        foreign = self.foreign
        plans = [*foreign.motions, foreign.levels, foreign.pump_sensor, foreign.panel]
        self.encoders = {
            plan.name: [MessageEncoder(each) for each in plan.messages]
            for plan in plans
            if plan is not None
        }
        self.says = {role: list(values) for role, values in SOUND.items()}
        self.word, self.status, self.ticks = RELEASED, 0x27, 0
        self.noise = 1.0  # without it what stands says nothing any more
        off = HardwiredInputs(Switch.OFF, Switch.OFF, Switch.OFF, Quality.GOOD)
        self.hardwired = load_catalogue().transmitter(HardwiredInputs), off

    def send(self, frame: Frame) -> None:
        self.guards[0].receive(frame)
        self.guards[1].receive(frame.can_id, frame.data)

    def tick(self) -> int:
        python, in_c = self.guards
        reasons = python.tick()
        assert in_c.tick() == reasons
        in_c.agrees(python)
        return reasons

    def run(self, ticks: int, without: Collection[str] = (), missing: Collection[str] = ()) -> int:
        """Reasons of the last tick, `without` some roles, or some messages as ROLE.MESSAGE."""
        reasons = 0
        for _ in range(ticks):
            for role, encoders in self.encoders.items():
                more = self.noise * NOISE[role] * (self.ticks % 3)
                values = [each + more for each in self.says[role]]
                for each in encoders:
                    due = self.ticks % (each.plan.cycle_ns // 10_000_000) == 0
                    if due and not {role, f"{role}.{each.plan.name}"} & {*without}:
                        now_ns = self.ticks * 10_000_000
                        bad = role in missing
                        self.send(each.frame(values, now_ns, missing=bad))
            if self.ticks % 2 == 0:
                sender, message = self.hardwired
                self.send(sender.frame(message))
                node = self.foreign.pump.bus << BUS_SHIFT | STANDARD | 5
                if "drive" not in without:
                    self.send(Frame(node | 0x180, self.status.to_bytes(2, "little") + bytes(4)))
                if "command" not in without:
                    self.send(Frame(node | 0x200, self.word.to_bytes(2, "little") + b"\x03\x00"))
            self.ticks += 1
            reasons = self.tick()
        return reasons

    def press(self, pressure_pa: float) -> None:
        """Arm, enable, and press."""
        assert self.run(30) == 0
        self.says["panel"][0] = 1.0
        assert self.run(30) == 0
        self.word = ENABLE
        self.says["pump_sensor"][0] = pressure_pa
        assert self.run(150) == 0
