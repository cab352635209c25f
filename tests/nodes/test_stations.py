"""One station is in command at a time; every one can stop."""

import pytest
from controller_bench import CATALOGUE, ControllerBench

from utank_hil.canbus import Address, AddressClaim, Heartbeat, Mode, OperatorCommand, Station
from utank_hil.nodes.redundancy import Redundancy

SECOND = Redundancy(second_station=True)
IDLE = OperatorCommand(Mode.STANDBY, False, False, False, False)


class Bench(ControllerBench):
    """A controller with a second panel."""

    def __init__(self, redundancy=SECOND):
        super().__init__(redundancy=redundancy)
        self.second_beats, self.second_versions = True, self.versions
        self.second: OperatorCommand | None = None
        self._second = CATALOGUE.transmitter(OperatorCommand, Address.OPERATOR_2)
        self._second_beats = CATALOGUE.transmitter(Heartbeat, Address.OPERATOR_2)

    def tick(self, late_ticks=0):
        if self._tick_index % 20 == 0 and self.second is not None:
            self.second_is()
            nan = float("nan")
            beat = Heartbeat(None, None, 0.0, *self.second_versions, nan, nan)
            if self.second_beats:
                self.send(self._second_beats.frame(beat))
        super().tick(late_ticks)

    def second_is(self, **changes):
        self.second = (self.second or IDLE)._replace(**changes)
        self.send(self._second.frame(self.second))

    @property
    def station(self):
        self.run(100)
        return self.status.station


def active_bench():
    bench = Bench()
    bench.second = IDLE
    bench.drive_at(20e3)
    assert bench.station is Station.OPERATOR
    return bench


def test_second_station_that_watches_neither_arms_nor_disarms_nor_resets():
    bench = active_bench()
    bench.run(2000)  # its arm bit is not set all the time
    assert bench.node.mode is Mode.ACTIVE
    bench = Bench()
    bench.second = IDLE
    bench.run(400)
    bench.second_is(arm=True, mode_request=Mode.ACTIVE, reset=True, retune=True)
    bench.run(1000)
    assert bench.node.mode is Mode.STANDBY
    assert not bench.node.inbox.stations.take_retuning(bench.now_ns).retune


def test_a_frame_of_the_station_that_watches_arms_nothing_in_its_tick():
    bench = Bench()
    bench.second = IDLE
    bench.run(400)
    bench.second_is(arm=True, mode_request=Mode.ACTIVE)
    wishes = bench.node.inbox.stations.take(bench.now_ns)
    assert (wishes.armed, wishes.arm_edge) == (False, False)


def test_a_station_that_is_switched_on_does_not_disarm():
    bench = Bench()
    bench.drive_at(20e3)
    bench.second = IDLE
    bench.run(1000)
    assert bench.node.mode is Mode.ACTIVE


def test_a_stop_before_any_accepted_frame_is_one():
    orders = Bench().node.inbox.stations.orders[Station.OPERATOR]
    orders.overhear(IDLE._replace(stop=True, arm=True, mode_request=Mode.ACTIVE))
    assert orders.take() == (False, True, False, False, False)


@pytest.mark.parametrize(("redundancy", "accepted"), [(SECOND, 1), (Redundancy(), 0)])
def test_a_station_that_is_not_declared_accepts_no_alarm(redundancy, accepted):
    bench = Bench(redundancy)
    bench.second = IDLE
    bench.run(400)
    bench.second_is(acknowledge=True)
    assert len(bench.node.inbox.stations.take_accepted()) == accepted


@pytest.mark.parametrize("taken", [False, True])
def test_stop_counts_from_any_station(taken):
    for first in (False, True):
        bench = active_bench()
        if taken:
            bench.second_is(arm=True, mode_request=Mode.ACTIVE, take_command=True)
            bench.run(300)
            assert bench.node.mode is Mode.ACTIVE
        (bench.order_is if first else bench.second_is)(stop=True)
        bench.tick()
        bench.tick()
        assert bench.pressure_pa == 0.0
        assert bench.node.mode is Mode.STANDBY


def test_a_stop_in_command_counts_in_a_tick_in_which_the_other_station_speaks():
    bench = active_bench()
    bench.second_is()
    bench.order_is(stop=True)
    bench.tick()
    bench.tick()
    assert bench.pressure_pa == 0.0
    assert bench.node.mode is Mode.STANDBY


def test_taking_the_command_resets_nothing():
    bench = active_bench()
    bench.order_is(stop=True, reset=True)
    bench.second_is(take_command=True, reset=True)
    wishes = bench.node.inbox.stations.take(0)
    assert wishes.stop
    assert not wishes.reset_edge
    assert not wishes.arm_edge


def test_a_stop_that_is_held_at_the_other_station_keeps_the_one_in_command_from_arming():
    bench = Bench()
    bench.second = IDLE
    bench.run(400)
    bench.second_is(stop=True)
    bench.run(290)  # the next frame of the second station comes 110 ms after the edge
    bench.order_is(mode_request=Mode.ACTIVE, arm=True)
    for _ in range(100):
        bench.tick()
        assert not bench.node.safety.supervisor.arming
        assert bench.node.mode is Mode.STANDBY
    bench.second_is(stop=False)
    bench.order_is(arm=False)
    bench.run(300)
    bench.order_is(arm=True)
    bench.run(300)
    assert bench.node.mode is Mode.ACTIVE


def test_a_station_that_went_silent_with_its_stop_held_stops_nobody_for_ever():
    bench = Bench()
    bench.second = IDLE
    bench.run(400)
    bench.second_is(stop=True)
    bench.second = None
    bench.run(1500)
    bench.order_is(mode_request=Mode.ACTIVE, arm=True)
    bench.run(300)
    assert bench.node.mode is Mode.ACTIVE


def test_command_is_taken_without_a_bump_and_given_back():
    bench = active_bench()
    bench.second_is(arm=True, mode_request=Mode.ACTIVE, take_command=True)
    assert bench.station is Station.OPERATOR_2
    bench.run(500)
    assert (bench.node.mode, bench.pressure_pa) == (Mode.ACTIVE, 20e3)
    bench.order_is()  # what it still says is no order
    bench.silent.add(OperatorCommand)  # nor is it missed
    bench.run(6000)
    assert bench.node.mode is Mode.ACTIVE
    bench.second_is(arm=False, mode_request=Mode.PASSIVE)
    bench.run(500)
    assert bench.node.mode is Mode.PASSIVE
    bench.silent.clear()
    bench.order_is(arm=False, mode_request=Mode.STANDBY)
    bench.run(1000)
    bench.order_is(take_command=True)
    assert bench.station is Station.OPERATOR
    bench.order_is(arm=True, mode_request=Mode.ACTIVE)
    bench.run(500)
    assert bench.node.mode is Mode.ACTIVE


def test_command_is_taken_without_a_bump_in_the_tick_of_a_frame_of_the_cycle():
    bench = active_bench()
    bench.second_is()
    bench.second_is(take_command=True, mode_request=Mode.ACTIVE, arm=True)
    bench.run(200)
    assert (bench.node.mode, bench.station) == (Mode.ACTIVE, Station.OPERATOR_2)


@pytest.mark.parametrize("second", [False, True])
def test_a_panel_that_claims_its_address_arms_by_no_bit_of_its_first_frame(second):
    """Its counter may be the next one by chance."""
    bench = Bench()
    bench.second = IDLE
    bench.run(1000)
    if second:
        bench.second_is(take_command=True)
        bench.run(400)
    address = Address.OPERATOR_2 if second else Address.OPERATOR
    bench.send(CATALOGUE.transmitter(AddressClaim, address).frame(AddressClaim(0x123)))
    pressed = {"mode_request": Mode.ACTIVE, "arm": True}
    bench.second_is(**pressed) if second else bench.order_is(**pressed)
    bench.run(1000)
    assert bench.node.mode is Mode.STANDBY
    released = {"arm": False}
    bench.second_is(**released) if second else bench.order_is(**released)
    bench.run(300)
    bench.second_is(**pressed) if second else bench.order_is(**pressed)
    bench.run(1000)
    assert bench.node.mode is Mode.ACTIVE


def test_the_claim_of_one_panel_takes_no_press_from_the_other():
    bench = Bench()
    bench.second = IDLE
    bench.run(1000)
    bench.send(CATALOGUE.transmitter(AddressClaim, Address.OPERATOR_2).frame(AddressClaim(0x123)))
    bench.order_is(mode_request=Mode.ACTIVE, arm=True)
    bench.run(1000)
    assert bench.node.mode is Mode.ACTIVE


def test_taking_the_command_enters_no_passive():
    bench = Bench()
    bench.second = IDLE
    bench.run(1000)
    bench.second_is(take_command=True, mode_request=Mode.PASSIVE)
    bench.run(1000)
    assert (bench.node.mode, bench.station) == (Mode.STANDBY, Station.OPERATOR_2)


def test_taking_the_command_with_the_arm_bit_set_never_arms():
    bench = Bench()
    bench.second = IDLE
    bench.run(400)
    bench.second_is(arm=True, mode_request=Mode.ACTIVE, take_command=True, retune=True)
    bench.run(1000)
    assert bench.station is Station.OPERATOR_2
    assert bench.node.mode is Mode.STANDBY
    assert not bench.node.inbox.stations.take_retuning(bench.now_ns).retune


@pytest.mark.parametrize("asked", [Mode.STANDBY, Mode.ACTIVE])
def test_a_station_that_takes_the_command_without_the_arm_bit_disarms(asked):
    bench = active_bench()
    bench.second_is(take_command=True, mode_request=asked)
    bench.tick()
    assert bench.node.mode is Mode.PASSIVE


def test_what_the_one_in_command_disarms_stays_so_when_the_other_takes_it_in_that_tick():
    bench = active_bench()
    bench.order_is(arm=False, mode_request=Mode.STANDBY)
    # it could not know of it
    bench.second_is(arm=True, mode_request=Mode.ACTIVE, take_command=True)
    bench.run(100)
    assert bench.node.mode is Mode.PASSIVE
    assert bench.station is Station.OPERATOR_2
    bench.run(1000)
    assert bench.node.mode is Mode.PASSIVE


def test_a_take_that_was_held_since_before_its_first_frame_is_none():
    bench = Bench()
    bench.second = IDLE._replace(take_command=True)
    bench.run(400)
    assert bench.station is Station.OPERATOR


def test_retuning_is_forbidden_while_either_station_says_so():
    bench = active_bench()
    stations = bench.node.inbox.stations

    def forbidden():
        bench.run(300)
        return stations.take_retuning(bench.now_ns).forbidden

    bench.order_is(forbid_retuning=True)
    assert forbidden()
    bench.second_is(take_command=True, arm=True, mode_request=Mode.ACTIVE)
    assert bench.station is Station.OPERATOR_2
    bench.second_is(take_command=False)
    assert forbidden()  # who takes the command is not to lift it
    bench.order_is(forbid_retuning=False)
    forbidden()
    assert not forbidden()
    bench.second_is(forbid_retuning=True)
    assert forbidden()
    bench.second_is(forbid_retuning=False)
    bench.order_is(forbid_retuning=True)
    assert forbidden()
    bench.silent.add(OperatorCommand)  # a panel that is gone forbids nothing for ever
    bench.run(1000)
    assert not forbidden()


def test_alarms_are_accepted_at_any_station():
    bench = active_bench()
    bench.silent.add(type(bench.motion))
    bench.run(500)
    assert bench.status.alarm
    bench.second_is(acknowledge=True)
    bench.run(200)
    assert not bench.status.alarm
