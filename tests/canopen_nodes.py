"""Object dictionaries of nodes as the package canopen plays them; nothing of this project."""

import canopen
from canopen import objectdictionary as od

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


def dictionary(*, torque=True):
    """Object dictionary of a drive in torque mode, or of one that knows nothing of torque."""
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
    target = (0x6071, 2) if torque else (0x60FF, 4)
    for index, size in ((0x6007, 2), (0x605A, 2), (0x605E, 2), (0x6040, 2), target, (0x6060, 1)):
        entry(index, 0, size, 0)
    entry(0x6041, 0, 2, 0x250, "ro")
    entry(0x6061, 0, 1, 0, "ro")
    entry(0x606C, 0, 4, 0, "ro")
    if torque:
        entry(0x6077, 0, 2, 0, "ro")
    entry(0x6502, 0, 4, 1 << 3 if torque else 1 << 2, "ro")
    return found
