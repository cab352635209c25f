"""A drive as the package canopen plays it, on a wire in this process."""

import canopen
from canopen import objectdictionary as od

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
STATES = {  # by CiA 402-2, for the control words of the way up and down
    (0x0250, 0x06): 0x0231, (0x0231, 0x07): 0x0233, (0x0233, 0x0F): 0x0237,
    (0x0237, 0x02): 0x0217, (0x0217, 0x00): 0x0250, (0x0217, 0x02): 0x0250,
    (0x0218, 0x80): 0x0250,
}  # fmt: skip


class Wire(canopen.Network):
    """What canopen sends goes to `said`; nothing runs beside."""

    def __init__(self):
        super().__init__()
        self.said = []

    def send_message(self, can_id, data, remote=False):
        assert not remote
        self.said.append((can_id, bytes(data)))

    def send_periodic(self, can_id, data, period, remote=False):
        class Task:
            def update(self, data): ...
            def stop(self): ...

        return Task()


def objects():
    """An empty object dictionary, and what adds an entry or a record to it."""
    found = od.ObjectDictionary()
    types = {1: od.UNSIGNED8, 2: od.UNSIGNED16, 4: od.UNSIGNED32}

    def entry(index, subindex, size, default, access="rw", whole=None):
        variable = od.ODVariable(f"{index:04X}:{subindex}", index, subindex)
        variable.data_type, variable.default, variable.access_type = types[size], default, access
        if whole is None:
            found.add_object(variable)
        else:
            whole.add_member(variable)

    def record(index, sizes):
        whole = od.ODRecord(f"{index:04X}", index)
        for subindex, (size, default, access) in sizes.items():
            entry(index, subindex, size, default, access, whole)
        found.add_object(whole)

    return found, entry, record


def valve_dictionary():
    """Object dictionary of a digital input and output module."""
    found, entry, record = objects()
    entry(0x1000, 0, 4, 0x30191, "ro")
    entry(0x1017, 0, 2, 0)
    record(0x1016, {0: (1, 1, "ro"), 1: (4, 0, "rw")})
    record(0x1029, {0: (1, 1, "ro"), 1: (1, 0, "rw")})
    for index, cob in ((0x1400, 0x200), (0x1800, 0x180)):
        sizes = {0: (1, 5, "ro"), 1: (4, cob + 9, "rw"), 2: (1, 254, "rw"), 3: (2, 300, "rw")}
        record(index, sizes | {5: (2, 100, "rw")})
        record(index + 0x200, {0: (1, 0, "rw"), **dict.fromkeys(range(1, 9), (4, 0, "rw"))})
    for index in (0x6000, 0x6200, 0x6206, 0x6207):
        record(index, {0: (1, 1, "ro"), 1: (1, 0xFF if index == 0x6207 else 0, "rw")})
    return found


def dictionary():
    """Object dictionary of a drive in torque mode."""
    found, entry, record = objects()
    entry(0x1000, 0, 4, 0x20192, "ro")
    entry(0x1017, 0, 2, 0)
    record(0x1016, {0: (1, 1, "ro"), 1: (4, 0, "rw")})
    record(0x1018, {0: (1, 4, "ro"), **{n: (4, 0x11 * n, "ro") for n in range(1, 5)}})
    for index, cob in ((0x1400, 0x200), (0x1800, 0x180), (0x1801, 0x280), (0x1802, 0x380)):
        record(
            index,
            {0: (1, 5, "ro"), 1: (4, cob + 5 | 1 << 30, "rw"), 2: (1, 254, "rw"),
             3: (2, 300, "rw"), 5: (2, 100, "rw")},
        )  # fmt: skip
        record(
            index + 0x200,
            {0: (1, 1, "rw"), 1: (4, 0x60410010, "rw"), **dict.fromkeys(range(2, 9), (4, 0, "rw"))},
        )
    for index, size in ((0x6007, 2), (0x605A, 2), (0x605E, 2), (0x6040, 2), (0x6071, 2),
                        (0x6060, 1)):  # fmt: skip
        entry(index, 0, size, 0)
    entry(0x6041, 0, 2, 0x250, "ro")
    entry(0x6061, 0, 1, 0, "ro")
    entry(0x606C, 0, 4, 0, "ro")
    entry(0x6077, 0, 2, 0, "ro")
    entry(0x6502, 0, 4, 1 << 3, "ro")
    return found


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
