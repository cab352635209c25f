"""Nodes as another maker would build them: from the DBC, with cantools and a library for E2E."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from pathlib import Path

import e2e
from cantools.database.can import Database

from utank_hil.canbus import Frame, NodeState
from utank_hil.canbus.catalogue import DBC_PATH
from utank_hil.configuration import Vessel, load_config

MS = 1_000_000
TANK = load_config(Path("configs/ships/thesis_first.yaml"), Vessel).tank
DATABASE = Database()
DATABASE.add_dbc_file(DBC_PATH)


class ForeignNode(ABC):
    """Sends and reads frames; `every` is the cycle of the DBC."""

    period_ns = 10 * MS
    versions = (0, 0)  # of catalogue and configuration

    def __init__(self, name: str) -> None:
        self.name = name
        self._counters: dict[str, int] = {}
        self.heard: dict[str, dict[str, float]] = {}

    def receive(self, frame: Frame, now_ns: int) -> None:
        message = DATABASE.get_message_by_frame_id(frame.can_id)
        self.heard[message.name] = dict(message.decode(frame.data, decode_choices=False))
        self.on(message.name, now_ns)

    def on(self, name: str, now_ns: int) -> None:  # noqa: B027  # few take note of one
        """Take note of a message that came."""

    @abstractmethod
    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Send what is due."""

    def frame(self, name: str, **values: float) -> Frame:
        message = DATABASE.get_message_by_name(name)
        counter = self._counters[name] = (self._counters.get(name, 0) + 1) % 16
        data = bytearray(message.encode({**values, "crc": 0, "counter": counter}, strict=False))
        ids = bytes.fromhex(message.dbc.attributes["DataIDs"].value)
        e2e.p02.e2e_p02_protect(data, ids, increment_counter=False)
        return Frame(message.frame_id, bytes(data))

    def due(self, name: str, now_ns: int) -> bool:
        return now_ns % (DATABASE.get_message_by_name(name).cycle_time * MS) == 0

    def life(self, now_ns: int) -> list[Frame]:
        """The heartbeat, when it is due."""
        name = f"HEARTBEAT_{self.name.upper()}"
        if not self.due(name, now_ns):
            return []
        return [self.frame(name, state=NodeState.OPERATIONAL, reset_cause=0, uptime_s=0,
                           catalogue_version=self.versions[0],
                           configuration_version=self.versions[1],
                           transmit_error_count=0, receive_error_count=0)]  # fmt: skip


class ForeignSensors(ForeignNode):
    """A ship that rolls as a sine, whatever the pump does; the pressure is what the drive says.

    The water moves as both push it: water that does not is found.
    """

    amplitude_rad, period_s = 0.05, 12.0

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.level_m = self.level_rate_m_s = 0.0

    def tick(self, now_ns: int) -> Iterable[Frame]:
        omega = 2 * math.pi / self.period_s
        angle = omega * now_ns * 1e-9
        frames = [self.frame("SENSOR_MOTION", roll_rad=self.amplitude_rad * math.sin(angle),
                             roll_rate_rad_s=self.amplitude_rad * omega * math.cos(angle),
                             quality=0)]  # fmt: skip
        if self.due("SENSOR_TANK", now_ns):
            self.move(self.amplitude_rad * math.sin(angle), omega)
            level_m = self.level_m
            frames += [
                self.frame("SENSOR_TANK", port_level_m=-level_m, starboard_level_m=level_m,
                           port_high=0, starboard_high=0, quality=0),
                self.frame("SENSOR_PUMP", pressure_pa=self.pressure_pa(), flow_m3_s=0, quality=0),
            ]  # fmt: skip
        return frames + self.life(now_ns)

    def move(self, roll_rad: float, omega_rad_s: float) -> None:
        """Water for 20 ms, thesis (2.19)."""
        lift_m = TANK.height_m + TANK.lz_m
        push = TANK.width_m * (9.80665 - lift_m * omega_rad_s**2) * roll_rad
        loss_pa = TANK.loss_pa_per_m_s * self.level_rate_m_s
        push += (self.pressure_pa() - loss_pa) / TANK.density_kg_m3 - 2 * 9.80665 * self.level_m
        self.level_rate_m_s += push / TANK.effective_length_m * 0.02
        self.level_m += self.level_rate_m_s * 0.02

    def pressure_pa(self) -> float:
        return self.heard.get("DRIVE_STATUS_1", {}).get("pressure_pa", 0.0)


# state of CiA 402 -> control word that leads on -> next state
STEPS = {(0x40, 0x06): 0x21, (0x21, 0x07): 0x23, (0x23, 0x0F): 0x27}


class ForeignDrive(ForeignNode):
    """A drive whose pressure is a little less than the command, and notes what it reported when."""

    share = 0.95
    lag_share = 0.1  # of the way to the command in a tick: a lag of 0.1 s
    silent = unavailable = False

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.state = 0x40
        self.pressure_pa = self.target_pa = 0.0
        self.reported: list[tuple[int, float]] = []

    def on(self, name: str, now_ns: int) -> None:
        if name != "PUMP_CMD":
            return
        command = self.heard[name]
        self.state = STEPS.get((self.state, int(command["control_word"])), self.state)
        self.target_pa = self.share * command["pressure_pa"] if self.state == 0x27 else 0.0

    def tick(self, now_ns: int) -> Iterable[Frame]:
        self.pressure_pa += self.lag_share * (self.target_pa - self.pressure_pa)
        if self.silent:
            return []
        frames = []
        if self.due("DRIVE_STATUS_1", now_ns):
            # cantools encodes raw numbers where they are out of range: 65535 is "not available"
            pressure_pa = 65535 * 8 - 262144 if self.unavailable else self.pressure_pa
            command = self.heard.get("PUMP_CMD", {"counter": 255})
            frames.append(self.report(pressure_pa, int(command["counter"])))
            self.reported.append((now_ns, self.pressure_pa))
        if self.due("DRIVE_STATUS_2", now_ns):
            frames.append(self.frame("DRIVE_STATUS_2", fault=0, bus_voltage_v=400, current_a=1,
                                     motor_temperature_c=40, drive_temperature_c=40,
                                     temperature_warning=0, voltage_warning=0, command_warning=0,
                                     sensor_warning=0))  # fmt: skip
        return frames + self.life(now_ns)

    def report(self, pressure_pa: float, echo: int) -> Frame:
        return self.frame("DRIVE_STATUS_1", pressure_pa=pressure_pa, speed_rad_s=0,
                          state=self.state, command_echo=echo, pressure_limited=0,
                          speed_limited=0, rate_limited=0, power_limited=0)  # fmt: skip


class ForeignPanel(ForeignNode):
    """Arms two seconds after its start."""

    def tick(self, now_ns: int) -> Iterable[Frame]:
        frames = []
        if self.due("OPERATOR_CMD", now_ns):
            arm = now_ns >= 2000 * MS
            frames.append(self.frame("OPERATOR_CMD", mode_request=3 if arm else 1, arm=arm, stop=0,
                                     reset=0, acknowledge=0, retune=0, undo=0,
                                     forbid_retuning=0, take_command=0, acknowledge_code=255,
                                     power_budget_w=65535 * 100))  # fmt: skip
        return frames + self.life(now_ns)
