"""A pump drive by CiA 402 as the package canopen plays it, with a motor and a pump of its own.

Nothing of this project is in it. In a process of its own, by ``python -m tests.canopen_motor BUS
TANK_BUS DBC``, it hears on TANK_BUS how fast the water flows, as a real pump feels it. What goes
wrong is told on its standard input: ``drop``, ``deaf``, ``mute`` (its heartbeat), ``emcy CODE``,
``trip CODE``, ``well``.
"""

import math
import select
import sys
import time
from contextlib import suppress

import canopen

from tests.canopen_nodes import Wire, dictionary

NODE = 5
AREA_M2, RADIUS_M, PITCH_M = 6.22, 0.985, 0.40  # pump of configs/ships/thesis_first.yaml
LIFT, FRICTION = 500 * 1.405, 500 * 0.005  # half the density times the coefficients
INERTIA_KG_M2 = 1700.0
MOST_NM = 200e3
NM_PER_UNIT = 80.0 * PITCH_M * AREA_M2  # by the ship's file: 80 Pa of pressure a count
RAD_S_PER_UNIT = 1e-3
RESERVOIR_M2 = 17.11
SPEED_LOOP_RAD_S = 30.0
STEP_S = 2e-3
READY, ON, RUNS, STOPS, OFF = 0x0231, 0x0233, 0x0237, 0x0217, 0x0250
REACTS, FAULT = 0x021F, 0x0218
WAY_UP = {(OFF, 0x06): READY, (READY, 0x07): ON, (ON, 0x0F): RUNS}
AT_REST_RAD_S = 0.3
HEARTBEAT_LOST = 0x8130  # CiA 301, table of emergency error codes
STATES = {"INITIALISING": 0, "STOPPED": 4, "OPERATIONAL": 5, "PRE-OPERATIONAL": 127}


class Motor:
    """The node on a network of canopen; `step` is called for the time that passes."""

    def __init__(self, network, *, torque=True):
        self.network, self.node = network, canopen.LocalNode(NODE, dictionary(torque=torque))
        self._in_nm = torque
        self._beats = isinstance(network, Wire)  # on a bus canopen sends heartbeats by itself
        network.add_node(self.node)
        network.subscribe(0, self._on_network_command)
        network.subscribe(0x80, self._on_sync)
        self.node.add_write_callback(self._on_write)
        self.now_s = 0.0
        self.flow_m3_s = 0.0
        self.speed_rad_s = self.load_nm = self.target = 0.0
        self.state = OFF
        self.commands = 0
        self.drops = self.deaf = self.mute = False
        self.first_dropped_s = math.inf
        self._watched, self._patience_s, self._beat_s = 0, math.inf, math.inf
        self._period_s, self._beat_due_s, self._lost = 0.0, 0.0, False
        self.operational = False
        network.send_message(0x700 + NODE, b"\0")
        self.node.nmt.state = "PRE-OPERATIONAL"

    def tell(self, words):
        """What goes wrong from now on."""
        match words.split():
            case ["drop"]:
                self.drops, self.commands = True, 0
                self.first_dropped_s = math.inf
            case ["deaf"]:
                self.deaf = True
            case ["mute"]:
                self.mute = True
                self.node.nmt.stop_heartbeat()
            case ["emcy", code]:
                self.node.emcy.send(int(code, 16), 0x81)
            case ["trip", code]:
                self.node.emcy.send(int(code, 16), 0x81)
                self.state = REACTS
            case ["well"]:
                if self.mute:
                    self.node.nmt.start_heartbeat(round(self._period_s * 1e3))
                self.drops = self.deaf = self.mute = False
                self.node.emcy.reset()
            case _:
                raise ValueError(words)

    def step(self, seconds):
        """Watch the controller, turn the rotor, and say that it lives."""
        self.now_s += seconds
        if self.operational and self.now_s - self._beat_s > self._patience_s:
            self._beat_s, self._lost = math.inf, True
            self.node.emcy.send(HEARTBEAT_LOST, 0x11)
            self._leave_operation()
        for _ in range(round(seconds / STEP_S)):
            self._turn()
        if self.state in (STOPS, REACTS) and abs(self._slip_m_s()) < PITCH_M * AT_REST_RAD_S:
            self.state = OFF if self.state == STOPS else FAULT
        if self._beats and self._period_s and self.now_s >= self._beat_due_s and not self.mute:
            self.network.send_message(0x700 + NODE, bytes([STATES[self.node.nmt.state]]))
            self._beat_due_s = self.now_s + self._period_s

    @property
    def pressure_pa(self):
        """What the pump gives: the torque of the water by pitch and area, as the ship has it."""
        return self.load_nm / (PITCH_M * AREA_M2)

    def _slip_m_s(self):
        return PITCH_M * self.speed_rad_s - self.flow_m3_s / AREA_M2

    def _turn(self):
        water_m_s, blade_m_s = self.flow_m3_s / AREA_M2, RADIUS_M * self.speed_rad_s
        past_m_s = math.hypot(water_m_s, blade_m_s)
        slip_m_s = PITCH_M * self.speed_rad_s - water_m_s
        drag = PITCH_M * LIFT * slip_m_s + FRICTION * RADIUS_M * blade_m_s
        self.load_nm = AREA_M2 * past_m_s * drag
        torque_nm = 0.0
        if self.state == RUNS:
            torque_nm = self.target
            if not self._in_nm:  # its own speed loop
                behind_rad_s = self.target - self.speed_rad_s
                torque_nm = self.load_nm + SPEED_LOOP_RAD_S * INERTIA_KG_M2 * behind_rad_s
        elif self.state in (STOPS, REACTS):
            torque_nm = -1e6 * slip_m_s
        torque_nm = min(max(torque_nm, -MOST_NM), MOST_NM)
        self.speed_rad_s += (torque_nm - self.load_nm) / INERTIA_KG_M2 * STEP_S

    def _on_write(self, index, subindex, data, **_):
        if index == 0x6060:
            self.node.set_data(0x6061, 0, data)
        elif index == 0x1017:
            self._period_s = int.from_bytes(data, "little") * 1e-3
        elif index == 0x1016 and subindex == 1:
            value = int.from_bytes(data, "little")
            if self._watched:
                self.network.unsubscribe(0x700 + self._watched)
            self._watched, self._patience_s = value >> 16, (value & 0xFFFF) * 1e-3
            if self._watched:
                self.network.subscribe(0x700 + self._watched, self._on_beat)

    def _on_beat(self, can_id, data, timestamp):
        if self._lost:
            self.node.emcy.reset()
        self._beat_s, self._lost = self.now_s, False

    def _on_network_command(self, can_id, data, timestamp):
        operational = self.node.nmt.state == "OPERATIONAL"
        if operational and not self.operational:
            self.node.rpdo.read()
            self.node.tpdo.read()
            self.node.rpdo[1].callbacks[:] = [self._on_command]
        if self.operational and not operational:
            self._leave_operation()
        self.operational = operational

    def _leave_operation(self):
        """React as 6007h says: 3 is a quick stop."""
        assert self.node.sdo[0x6007].raw == 3
        if self.state == RUNS:
            self.state = STOPS

    def _on_command(self, pdo):
        if not self.operational:
            return
        self.commands += 1
        if self.deaf or (self.drops and self.commands % 5):
            self.first_dropped_s = min(self.first_dropped_s, self.now_s)
            return
        for variable in pdo.map:
            self.node.set_data(variable.index, 0, variable.get_data())
        word = self.node.sdo[0x6040].raw
        index, half = (0x6071, 1 << 15) if self._in_nm else (0x60FF, 1 << 31)
        raw = (self.node.sdo[index].raw ^ half) - half
        self.target = raw * (NM_PER_UNIT if self._in_nm else RAD_S_PER_UNIT)
        if self.state == FAULT:
            self.state = OFF if word & 0x80 else FAULT
        elif self.state in (RUNS, STOPS) and word & 0x06 == 0x02:
            self.state = STOPS
        elif self.state != REACTS and not word & 0x02:
            self.state = OFF
        else:
            self.state = WAY_UP.get((self.state, word & 0x0F), self.state)

    def _on_sync(self, can_id, data, timestamp):
        if not self.operational:
            return
        values = {
            0x6041: self.state,
            0x606C: round(self.speed_rad_s / RAD_S_PER_UNIT) & 0xFFFFFFFF,
            0x6077: round(self.load_nm / NM_PER_UNIT) & 0xFFFF,
        }
        for number in (1, 2):
            pdo = self.node.tpdo[number]
            if pdo.enabled and pdo.trans_type == 1:
                for variable in pdo.map:
                    index = variable.index
                    if index in values:
                        variable.raw = values[index]
                    else:
                        variable.set_data(self.node.get_data(index, 0))
                pdo.transmit()


class MotorNode:
    """The motor among nodes that run in lockstep; `killed` it is gone, `unplugged` it is deaf."""

    name = "canopen motor"

    def __init__(self, frame_of, period_ns, flow, *, torque=True):
        self.wire = Wire()
        self.motor = Motor(self.wire, torque=torque)
        self._frame_of, self.period_ns, self._flow = frame_of, period_ns, flow
        self.killed = self.unplugged = False

    def receive(self, frame, now_ns):
        """Hand a frame of its own bus on; `frame_of` gave its tag."""
        can_id = frame.can_id ^ self._frame_of(0, b"").can_id
        if can_id < 0x800 and not (self.killed or self.unplugged):
            self.wire.notify(can_id, bytearray(frame.data), now_ns * 1e-9)

    def tick(self, now_ns):
        """Pass a tick."""
        if self.killed:
            return []
        self.motor.flow_m3_s = self._flow()
        self.motor.step(self.period_ns * 1e-9)
        said, self.wire.said[:] = list(self.wire.said), []
        return [self._frame_of(*each) for each in said]


class Flow:
    """The water's flow by the levels that SENSOR_TANK tells, decoded by cantools."""

    def __init__(self, channel, dbc):
        import can
        import cantools

        self._message = cantools.database.load_file(dbc).get_message_by_name("SENSOR_TANK")
        only = {"can_id": self._message.frame_id, "can_mask": 0x1FFFFFFF, "extended": True}
        self.bus = can.Bus(channel, interface="socketcan", can_filters=[only])
        self._level_m, self._at_s, self.m3_s = math.nan, 0.0, 0.0

    def look(self):
        """Take what has come."""
        while (message := self.bus.recv(0)) is not None:
            said = self._message.decode(bytes(message.data), decode_choices=False)
            level_m = (said["starboard_level_m"] - said["port_level_m"]) / 2
            passed_s = message.timestamp - self._at_s
            if 0 < passed_s < 0.5:
                m3_s = RESERVOIR_M2 * (level_m - self._level_m) / passed_s
                self.m3_s += min(passed_s / 0.2, 1.0) * (m3_s - self.m3_s)
            self._level_m, self._at_s = level_m, message.timestamp


def main():
    import os

    import can

    with suppress(PermissionError):  # as a drive does, it comes before what else there is
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))
    channel, tank_channel, dbc = sys.argv[1:]
    network = canopen.Network()
    network.bus = can.Bus(channel, interface="socketcan")
    motor, flow = Motor(network), Flow(tank_channel, dbc)
    then_s = time.monotonic()
    print("ready", flush=True)
    while True:
        ready, _, _ = select.select([network.bus, flow.bus, sys.stdin], [], [], 0.01)
        if sys.stdin in ready:
            words = sys.stdin.readline()
            if not words:
                return
            motor.tell(words)
            print(f"{time.time():.4f} {words.strip()}", flush=True)
        flow.look()
        motor.flow_m3_s = flow.m3_s
        now_s = time.monotonic()
        if now_s - then_s >= STEP_S:
            steps = math.floor((now_s - then_s) / STEP_S)
            motor.step(min(steps, 100) * STEP_S)
            then_s += steps * STEP_S
        while (message := network.bus.recv(0)) is not None:
            network.notify(message.arbitration_id, message.data, message.timestamp)


if __name__ == "__main__":
    main()
