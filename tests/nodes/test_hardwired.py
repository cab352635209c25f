"""What the hard-wired inputs say, frame by frame."""

import pytest
from controller_bench import CATALOGUE

from utank_hil.canbus import Frame, HardwiredInputs, Quality, Switch
from utank_hil.nodes.hardwired import HardwiredHeard

SHUT = HardwiredInputs(Switch.OFF, Switch.OFF, Switch.OFF, Quality.GOOD)
NOT_OFF = [switch for switch in Switch if switch is not Switch.OFF]


class Line:
    def __init__(self):
        self.sender = CATALOGUE.transmitter(HardwiredInputs)
        self.heard = HardwiredHeard(CATALOGUE.receiver(HardwiredInputs))
        self.now_ns = 0

    def say(self, *, lost=0, **changes):
        """Send frames of which the last arrives."""
        for _ in range(lost + 1):
            frame = self.sender.frame(SHUT._replace(**changes))
            self.now_ns += 1
        inputs = self.heard.accept(frame)
        if inputs is not None:
            self.heard.take(inputs, self.now_ns)
        return self.heard


def test_shut_and_low_stop_nothing():
    line = Line()
    assert line.heard.heard_ns < 0
    assert not any((line.heard.take_stop(), line.heard.high_level))
    heard = line.say()
    assert heard.heard_ns == 1
    assert not any((heard.take_stop(), heard.high_level))


@pytest.mark.parametrize("name", ["port_high", "starboard_high"])
@pytest.mark.parametrize("switch", NOT_OFF)
@pytest.mark.parametrize("quality", Quality)
def test_each_switch_closed_or_broken_is_a_high_level(name, switch, quality):
    line = Line()
    assert line.say(**{name: switch}, quality=quality).high_level
    assert not line.say().high_level


@pytest.mark.parametrize("switch", NOT_OFF)
@pytest.mark.parametrize("lost", [0, 9])
def test_an_open_loop_stops_from_any_intact_frame(switch, lost):
    line = Line()
    line.say()
    heard = line.say(lost=lost, stop_loop=switch)
    assert heard.stop
    for _ in range(3):
        line.say()
    assert not heard.stop
    assert heard.take_stop()  # in a frame since the last look
    assert not heard.take_stop()


@pytest.mark.parametrize("quality", Quality)
def test_only_a_healthy_node_says_that_the_loop_is_shut(quality):
    line = Line()
    line.say(stop_loop=NOT_OFF[0])
    usable = quality in (Quality.GOOD, Quality.DEGRADED)
    heard = line.say(quality=quality)
    assert heard.stop is not usable
    assert heard.heard_ns == (2 if usable else 1)
    # what a frame said counts once; an open loop, in every tick until it is shut
    assert [heard.take_stop() for _ in range(3)] == [True, not usable, not usable]


def test_a_damaged_frame_says_nothing():
    line = Line()
    line.say()
    frame = line.sender.frame(SHUT._replace(stop_loop=NOT_OFF[0]))
    damaged = Frame(frame.can_id, frame.data[:-1] + bytes((frame.data[-1] ^ 1,)))
    assert line.heard.accept(damaged) is None
    assert not line.heard.take_stop()
