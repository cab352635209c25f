"""A drive as the package canopen plays it, on a wire in this process."""

import canopen

from tests.canopen_nodes import STATES, Wire, dictionary
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import ControlWord, Frame
from utank_hil.canbus.frame import STANDARD
from utank_hil.configuration.device_sections import DriveSection
from utank_hil.dynamics.pump import Pump
from utank_hil.nodes.canopen_drive import CanopenDrive

PUMP = Pump.for_duct(6.22)
PROFILE = {
    "profile": "cia402",
    "node": 5,
    "mode": "torque",
    "pressure_pa_per_unit": 80.0,
    "speed_rad_s_per_unit": 1e-3,
    "identity": [0x11, 0x22, None, 0x44],
}


class Line:
    """The controller's drive and a `LocalNode` of canopen, tick by tick."""

    def __init__(self, changes=(), tweak=lambda _: None, loop=None):
        self.wire, self.node = Wire(), canopen.LocalNode(5, dictionary())
        tweak(self.node.object_dictionary)
        self.wire.add_node(self.node)
        self.plan = DriveSection(**(PROFILE | dict(changes))).plan(0, PUMP)
        self.drive = CanopenDrive(self.plan, loop, 17.1)
        self.reports, self.commands, self.now_ns = [], [], 0
        self.drive.deliver = lambda report, now_ns: self.reports.append((now_ns, report))
        self.passes = lambda number: True
        self.sent = 0
        self.beats = True
        self.node.add_write_callback(self._mode)

    def _mode(self, index, data, **_):
        if index == 0x6060:
            self.node.set_data(0x6061, 0, data)

    def run(self, ticks, word=ControlWord.DISABLE_VOLTAGE, target=0.0):
        for _ in range(ticks):
            frames = self.drive.frames(self.now_ns)
            if self.now_ns // TICK_NS % 2 == 0:
                frames = frames + self.drive.follow(target, word)
            for frame in frames:
                self._to_the_drive(frame)
            beats = self.beats and self.node.sdo[0x1017].raw  # as often as it was told
            if beats and self.now_ns // TICK_NS % 5 == 0:
                state = {"OPERATIONAL": 5, "PRE-OPERATIONAL": 127, "STOPPED": 4}
                self.wire.said.append((0x705, bytes([state.get(self.node.nmt.state, 127)])))
            for can_id, data in self.wire.said:
                taker = self.drive.takers.get(can_id | STANDARD)
                if taker is not None:
                    taker.take(Frame(can_id | STANDARD, data), self.now_ns + TICK_NS // 2)
            self.wire.said.clear()
            self.now_ns += TICK_NS
        return self

    def _to_the_drive(self, frame):
        can_id = frame.can_id & 0x7FF
        if can_id == 0x205:
            self.sent += 1
            if not self.passes(self.sent):
                return
            self.commands.append(frame.data)
            if self.node.nmt.state == "OPERATIONAL":
                self.node.rpdo[1].on_message(0x205, frame.data, 0.0)
                word = int.from_bytes(frame.data[:2], "little")
                for variable in self.node.rpdo[1].map:
                    self.node.set_data(variable.index, 0, variable.get_data())
                state = self.node.sdo[0x6041].raw
                if word & 0x80 and state & 0x4F != 0x08:
                    word = 0
                self.node.sdo[0x6041].raw = STATES.get((state, word), state)
        elif can_id == 0x80 and self.node.nmt.state == "OPERATIONAL":
            for number in (1, 2):
                pdo = self.node.tpdo[number]
                if pdo.enabled and pdo.trans_type == 1:
                    for variable in pdo.map:
                        variable.set_data(self.node.get_data(variable.index, 0))
                    pdo.transmit()
        elif can_id == 0 or self.node.nmt.state != "STOPPED":  # where there is no SDO, by CiA 301
            self.wire.notify(can_id, bytearray(frame.data), 0.0)
            if can_id == 0 and frame.data[0] == 1:
                self.node.rpdo.read()
                self.node.tpdo.read()
