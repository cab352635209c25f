"""Several interfaces as one port: each frame keeps to its own, and errors to theirs."""

import pytest

from utank_hil.canbus import Frame, PortError
from utank_hil.canbus.frame import BUS_SHIFT
from utank_hil.canbus.ports import BusPorts, open_buses
from utank_hil.canbus.profiles.device_plan import ForeignDevices


class Interface:
    def __init__(self, *heard):
        self.heard, self.sent, self.closed = list(heard), [], False
        self.error = None
        self.others = 3

    def send(self, frame):
        self.sent.append(frame)

    def receive(self):
        if self.error is not None:
            raise PortError(self.error)
        frames, self.heard = self.heard, []
        return frames

    def close(self):
        self.closed = True


def test_frames_carry_the_number_of_their_interface_and_none_is_forwarded():
    own, second = Interface(Frame(5, b"a")), Interface(Frame(5, b"b"))
    ports = BusPorts([own, second])
    assert ports.receive() == [Frame(5, b"a"), Frame(1 << BUS_SHIFT | 5, b"b")]
    assert (own.sent, second.sent) == ([], [])
    ports.send(Frame(7, b""))
    ports.send(Frame(1 << BUS_SHIFT | 8, b""))
    assert (own.sent, second.sent) == ([Frame(7, b"")], [Frame(8, b"")])
    assert ports.others == 3


def test_an_error_of_the_own_interface_loses_no_frame_of_another():
    own, second = Interface(), Interface(Frame(1, b""))
    own.error = "bus-off"
    ports = BusPorts([own, second])
    assert len(ports.receive()) == 1
    with pytest.raises(PortError, match="bus-off"):
        ports.receive()
    own.error = None
    assert ports.receive() == []


def test_an_error_of_a_sensors_interface_is_told_once_and_ends_nothing():
    own, second = Interface(Frame(1, b"")), Interface()
    second.error = "interface down"
    ports = BusPorts([own, second])
    assert len(ports.receive()) == 1
    assert [str(each) for each in ports.take_errors()] == ["interface down"]
    assert ports.receive() == []
    assert ports.take_errors() == []
    second.error = "not found"
    ports.receive()
    assert [str(each) for each in ports.take_errors()] == ["not found"]
    second.error = None
    ports.receive()
    assert ports.take_errors() == []  # it works again
    second.error = "not found"
    ports.receive()
    assert [str(each) for each in ports.take_errors()] == ["not found"]


def test_the_own_interface_is_not_opened_twice():
    with pytest.raises(PortError, match="leave out bus: can1"):
        open_buses("can1", ForeignDevices(buses=("", "can1")))


def test_all_are_closed():
    interfaces = [Interface(), Interface()]
    BusPorts(interfaces).close()
    assert all(each.closed for each in interfaces)
