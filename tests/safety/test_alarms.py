"""An alarm stays until it was accepted and its cause has gone; nothing silences it otherwise."""

import pytest
from controller_bench import CATALOGUE, MS, ControllerBench
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.canbus import (
    Alarm,
    AlarmState,
    DriveFault,
    DriveStatus1,
    Fault,
    Mode,
    SensorMotion,
    SensorTank,
    Switch,
)
from utank_hil.canbus.events import AlarmEvent
from utank_hil.safety.alarms import GONE_NS, AlarmList, Gravity, active_faults, gravest
from utank_hil.safety.faults import Reaction
from utank_hil.safety.judging import CONDITIONS

SECOND_NS = 1_000_000_000
HIGH, SILENT = Fault.LEVEL_LIMIT, Fault.TANK_SILENT
ACTIVE, ACCEPTED, RECTIFIED, NORMAL = AlarmState


class Table:
    """An alarm list that is looked at ten times a second."""

    def __init__(self):
        self.list = AlarmList()
        self.now_ns = 0

    def run(self, seconds, *active, gravity=Gravity.NOTHING):
        for _ in range(round(10 * seconds)):
            self.list.update(dict.fromkeys(active, gravity), Mode.STANDBY, self.now_ns)
            self.list.next_message(self.now_ns)
            self.now_ns += SECOND_NS // 10

    def accept(self, code=None):
        self.list.accept(code, Mode.STANDBY, self.now_ns)

    @property
    def states(self):
        return [event.state for event in self.list.take_events() if event.state is not None]

    @property
    def shown(self):
        first = self.list.next_message(self.now_ns)
        assert first.alarms is not None
        rest = [self.list.next_message(self.now_ns) for _ in range(first.alarms - 1)]
        messages = sorted([first, *rest], key=lambda message: message.place or 0)
        assert [message.place for message in messages] == list(range(len(messages)))
        return [(message.code, message.state) for message in messages]


def test_accepted_first_it_goes_with_its_cause():
    table = Table()
    table.run(1, HIGH)
    assert table.list.unaccepted
    table.accept()
    assert not table.list.unaccepted
    assert table.shown == [(HIGH, ACCEPTED)]
    table.run(5, HIGH)
    table.run(9)
    assert table.shown == [(HIGH, ACCEPTED)]
    table.run(2)
    assert table.shown == [(Fault.NONE, NORMAL)]
    assert table.states == [ACTIVE, ACCEPTED, NORMAL]


def test_gone_first_it_stays_until_it_is_accepted():
    table = Table()
    table.run(1, HIGH)
    table.run(3600)
    assert table.list.unaccepted
    assert table.shown == [(HIGH, RECTIFIED)]
    table.accept()
    assert not table.list.unaccepted
    assert table.states == [ACTIVE, RECTIFIED, NORMAL]


def test_a_cause_that_comes_back_alarms_again():
    table = Table()
    for _ in range(3):
        table.run(1, HIGH)
        table.run(11)
    message = table.list.next_message(table.now_ns)
    assert (message.times_raised, message.state) == (3, RECTIFIED)
    assert message.age_s == pytest.approx(12.0, abs=0.11)
    table.accept()
    table.run(1, HIGH)
    assert table.list.unaccepted
    assert table.list.next_message(table.now_ns).times_raised == 1


def test_a_cause_has_gone_after_ten_seconds_and_not_before():
    alarms = AlarmList()
    alarms.update({HIGH: Gravity.NOTHING}, Mode.STANDBY, 0)
    for now_ns, state in ((10 * SECOND_NS - 1, ACTIVE), (10 * SECOND_NS, RECTIFIED)):
        alarms.update({}, Mode.STANDBY, now_ns)
        assert alarms.next_message(now_ns).state is state


@pytest.mark.parametrize("raised_anew", [True, False])
@pytest.mark.parametrize(("less_grave_s", "alarms_again"), [(9.9, False), (10.0, True)])
def test_what_is_less_grave_for_ten_seconds_or_raised_anew_alarms_when_it_is_grave_again(
    raised_anew, less_grave_s, alarms_again
):
    alarms = AlarmList()
    alarms.update({SILENT: Gravity.ENDS}, Mode.ACTIVE, 0)
    if raised_anew:
        alarms.raise_anew(SILENT, Mode.STANDBY, SECOND_NS)
    for seconds in (5.0, less_grave_s):
        alarms.update({SILENT: Gravity.NOTHING}, Mode.STANDBY, round(seconds * SECOND_NS))
    alarms.next_message(0)
    alarms.accept(None, Mode.STANDBY, 0)
    alarms.update({SILENT: Gravity.ENDS}, Mode.ACTIVE, 11 * SECOND_NS)
    assert alarms.unaccepted == (alarms_again or raised_anew)


def test_alarms_are_sent_one_after_the_other_from_the_most_urgent_on():
    alarms = AlarmList()
    assert alarms.next_message(0) == Alarm(NORMAL, Fault.NONE, 0, 0, 0, 0.0)
    alarms = AlarmList()
    faults = [SILENT, Fault.NOISE, HIGH]
    alarms.update(dict.fromkeys(faults, Gravity.NOTHING), Mode.STANDBY, 0)
    sent = [alarms.next_message(0).code for _ in range(4)]
    assert sent == [HIGH, SILENT, Fault.NOISE, HIGH]


@pytest.mark.parametrize(
    ("code", "most"),
    [(HIGH, Gravity.ENDS), (Fault.MOTION_SILENT, Gravity.ENDS), (Fault.NOISE, Gravity.NOTHING),
     (Fault.DRIVE_WARNING, Gravity.NOTHING), (Fault.PUMP_SENSOR_SILENT, Gravity.ENDS)],
)  # fmt: skip
def test_the_most_that_a_fault_may_do_is_the_gravest_of_its_reactions(code, most):
    """Of the table in docs/safety.md."""
    assert gravest(code) is most


def bits(*codes, reaction=None):
    return sum(
        1 << place
        for place, (code, condition) in enumerate(CONDITIONS)
        if code in codes and reaction in (None, condition.reaction)
    )


@pytest.mark.parametrize(
    ("mode", "fault", "standing", "active"),
    [
        # a ramp ends control, and says nothing where there is none
        (Mode.ACTIVE, Fault.NONE, bits(Fault.MOTION_SILENT, reaction=Reaction.RAMP),
         {Fault.MOTION_SILENT: Gravity.ENDS}),
        (Mode.PASSIVE, Fault.NONE, bits(Fault.MOTION_SILENT, reaction=Reaction.RAMP), {}),
        (Mode.ACTIVE, Fault.NONE, bits(SILENT, reaction=Reaction.HALVE), {SILENT: Gravity.HALVES}),
        (Mode.STANDBY, Fault.NONE, bits(SILENT, reaction=Reaction.HALVE), {}),
        # a stop counts everywhere, in INIT but for what is awaited
        (Mode.PASSIVE, Fault.NONE, bits(HIGH), {HIGH: Gravity.ENDS}),
        (Mode.INIT, Fault.NONE, bits(HIGH, Fault.DRIVE_SILENT), {HIGH: Gravity.ENDS}),
        (Mode.STANDBY, Fault.NONE, bits(Fault.DRIVE_SILENT), {Fault.DRIVE_SILENT: Gravity.ENDS}),
        (Mode.INIT, Fault.DRIVE_SILENT, 0, {Fault.DRIVE_SILENT: Gravity.NOTHING}),
        # what is latched, and a second one beside it
        (Mode.FAULT, HIGH, 0, {HIGH: Gravity.ENDS}),
        (Mode.FAULT, HIGH, bits(SILENT), {HIGH: Gravity.ENDS, SILENT: Gravity.ENDS}),
        (Mode.STANDBY, HIGH, 0, {}),
        (Mode.ACTIVE, Fault.NONE, bits(Fault.NOISE), {Fault.NOISE: Gravity.NOTHING}),
    ],
)  # fmt: skip
def test_what_is_active_in_each_mode(mode, fault, standing, active):
    """By the first list of docs/safety.md, *Alarms*."""
    assert active_faults(mode, fault, standing) == active


def test_a_cause_that_comes_with_each_roll_alarms_once():
    table = Table()
    for _ in range(100):
        table.run(1, HIGH)
        table.run(8)
    assert table.states == [ACTIVE]


def test_a_second_fault_alarms_though_the_first_is_accepted_the_urgent_one_first():
    table = Table()
    table.run(1, SILENT)
    table.accept()
    table.run(1, SILENT, HIGH)
    assert table.list.unaccepted
    assert table.shown == [(HIGH, ACTIVE), (SILENT, ACCEPTED)]
    table.accept(SILENT)
    assert table.list.unaccepted
    table.accept(HIGH)
    assert not table.list.unaccepted


steps = st.lists(
    st.tuples(
        st.sets(st.sampled_from([HIGH, SILENT, Fault.DRIVE_FAULT])),
        st.sampled_from([None, HIGH, SILENT, Fault.NONE]) | st.just("no"),
        st.integers(1, 150),
    ),
    max_size=20,
)


@given(steps)
def test_no_alarm_leaves_the_list_unaccepted_or_with_its_cause(history):
    table = Table()
    waiting: set[Fault | None] = set()
    for active, accepted, ticks in history:
        for _ in range(ticks):
            table.run(0.1, *active)
        shown = dict(table.shown)
        for event in table.list.take_events():
            if event.state is ACTIVE:
                waiting.add(event.code)
        assert active <= shown.keys()
        assert waiting <= shown.keys()
        assert table.list.unaccepted == bool(
            {code for code, state in shown.items() if state in (ACTIVE, RECTIFIED)}
        )
        if accepted != "no":
            assert accepted is None or isinstance(accepted, Fault)
            table.accept(accepted)
            waiting -= {accepted} if accepted is not None else waiting
    table.run(GONE_NS / SECOND_NS + 1)
    table.accept()
    assert table.shown == [(Fault.NONE, NORMAL)]


def alarms_in(frames):
    receiver = CATALOGUE.receiver(Alarm)
    heard = [receiver.accept(frame) for frame in frames if frame.can_id == receiver.can_id]
    return [alarm for alarm in heard if alarm is not None]


def codes(bench):
    """Alarms that the node sends within half a second."""
    before = len(bench.sent)
    bench.run(500)
    return {alarm.code for alarm in alarms_in(bench.sent[before:])}


def test_a_quiet_start_alarms_of_nothing_and_a_long_wait_of_what_is_missing():
    bench = ControllerBench()
    bench.run(2000)
    assert codes(bench) == {Fault.NONE}
    bench = ControllerBench()
    bench.silent.add(type(bench.tank))
    bench.run(9000)
    assert codes(bench) == {Fault.NONE}
    bench.run(1000)
    assert codes(bench) == {Fault.TANK_SILENT}


def test_while_it_waits_for_one_thing_what_is_dangerous_alarms_all_the_same():
    bench = ControllerBench()
    bench.silent.add(SensorMotion)
    bench.run(10_500)
    assert bench.node.mode is Mode.INIT
    assert codes(bench) == {Fault.MOTION_SILENT}
    bench.tank = bench.tank._replace(port_high=Switch.ON)
    bench.drive_fault = DriveFault.OVERCURRENT
    bench.run(300)
    assert codes(bench) == {Fault.MOTION_SILENT, HIGH, Fault.DRIVE_FAULT}


def test_of_several_things_that_are_awaited_one_alarms():
    bench = ControllerBench()
    bench.silent = {SensorMotion, DriveStatus1}
    bench.run(10_500)
    assert codes(bench) == {Fault.MOTION_SILENT}


def test_alarm_of_a_fault_outlives_its_reset_until_it_is_accepted():
    bench = ControllerBench()
    bench.drive_at(20e3)
    bench.tank = bench.tank._replace(port_high=Switch.ON)
    bench.run(300)
    assert bench.node.fault is HIGH
    bench.tank = bench.tank._replace(port_high=Switch.OFF)
    bench.order_is(arm=False, mode_request=Mode.STANDBY, reset=True)
    bench.run(11_000)
    assert bench.node.mode is Mode.STANDBY
    assert bench.status.alarm
    assert codes(bench) == {HIGH}
    bench.order_is(acknowledge=True, acknowledge_code=SILENT)
    bench.run(200)
    assert codes(bench) == {HIGH}
    bench.order_is(acknowledge=False)
    bench.order_is(acknowledge=True, acknowledge_code=HIGH)
    bench.run(200)
    assert not bench.status.alarm
    assert codes(bench) == {Fault.NONE}


def test_a_warning_of_the_drive_alarms_within_two_messages_and_changes_no_command():
    bench = ControllerBench()
    bench.drive_at(20e3)
    bench.drive_warns = True
    bench.run(200)
    assert bench.node.safety.alarms.codes == {Fault.DRIVE_WARNING}
    bench.run(1000)
    assert (bench.node.mode, bench.node.fault) == (Mode.ACTIVE, Fault.NONE)
    assert bench.node.command_pa == 20e3
    bench.drive_warns = False
    bench.order_is(acknowledge=True)
    bench.run(11_000)
    assert codes(bench) == {Fault.NONE}


@pytest.mark.parametrize("second", [HIGH, SILENT])
def test_second_fault_while_the_first_is_latched_alarms_again(second):
    bench = ControllerBench()
    bench.drive_at(20e3)
    bench.drive_fault = DriveFault.STALL
    bench.run(300)
    bench.order_is(acknowledge=True)
    bench.run(300)
    assert not bench.status.alarm
    if second is HIGH:
        bench.tank = bench.tank._replace(starboard_high=None)
    else:
        bench.silent.add(type(bench.tank))
    bench.run(300)
    assert bench.node.fault is Fault.DRIVE_FAULT
    assert bench.status.alarm
    assert codes(bench) == {Fault.DRIVE_FAULT, second}


def test_refused_arming_and_refused_reset_are_told_with_their_reasons():
    told: list[AlarmEvent] = []
    bench = ControllerBench()
    bench.node.telemetry._event_sink = lambda event, _: told.append(event)  # type: ignore[arg-type]
    bench.tank = bench.tank._replace(port_high=Switch.ON)
    bench.run(400)
    bench.order_is(mode_request=Mode.ACTIVE, arm=True)
    bench.run(400)
    assert [(event.code, event.state) for event in told] == [(HIGH, ACTIVE)] * 2
    assert [event.time_ns for event in told] == [0, 400 * MS]
    bench = ControllerBench()
    told.clear()
    bench.drive_at(20e3)
    bench.node.telemetry._event_sink = lambda event, _: told.append(event)  # type: ignore[arg-type]
    bench.drive_fault = DriveFault.STALL
    bench.run(300)
    bench.order_is(reset=True)
    bench.run(1000)
    assert [(event.code, event.state, event.mode) for event in told] == [
        (Fault.DRIVE_FAULT, ACTIVE, Mode.FAULT),
        (Fault.DRIVE_FAULT, None, Mode.FAULT),
    ]
    # and one that is not refused is no event
    bench.drive_fault = DriveFault.NONE
    bench.order_is(reset=False)
    bench.run(100)
    bench.order_is(reset=True)
    bench.run(300)
    assert bench.node.mode is Mode.STANDBY
    assert len(told) == 2


def test_accepting_counts_for_what_was_sent():
    table = Table()
    table.list.update({HIGH: Gravity.ENDS}, Mode.STANDBY, 0)
    table.accept()
    table.accept(HIGH)
    assert table.list.unaccepted
    table.run(0.1, HIGH)
    table.accept()
    assert table.states == [ACTIVE, ACCEPTED]
    table.list.raise_anew(HIGH, Mode.FAULT, table.now_ns)
    table.accept()
    assert table.list.unaccepted


def test_what_is_graver_than_what_was_accepted_alarms_again_and_what_is_less_grave_does_not():
    table = Table()
    table.run(1, HIGH)
    table.accept()
    table.run(1, HIGH, gravity=Gravity.HALVES)
    assert table.states == [ACTIVE, ACCEPTED, ACTIVE]
    table.accept()
    for gravity in (Gravity.ENDS, Gravity.NOTHING, Gravity.ENDS):
        table.run(9, HIGH, gravity=gravity)
        table.accept()
    assert table.states == [ACCEPTED, ACTIVE, ACCEPTED]  # as of a roll: it was never gone
    table.run(11, HIGH)
    table.run(1, HIGH, gravity=Gravity.ENDS)
    assert table.states == [ACTIVE]


def test_how_often_it_was_raised_counts_since_it_was_accepted():
    table = Table()
    for raised in (1, 2):
        table.list.raise_anew(HIGH, Mode.FAULT, 0)
        assert table.list.next_message(0).times_raised == raised
    table.accept()
    table.list.raise_anew(HIGH, Mode.FAULT, 0)
    assert table.list.next_message(0).times_raised == 1


class Told(ControllerBench):
    """With the alarms that the node tells of."""

    def __init__(self):
        self.told: list[AlarmEvent] = []
        super().__init__(event_sink=lambda event, _: self.told.append(event))

    def accept(self):
        self.order_is(acknowledge=True)
        self.run(200)
        assert not self.node.safety.alarms.unaccepted
        self.order_is(acknowledge=False)
        self.told.clear()


def test_what_is_raised_in_the_tick_of_an_acceptance_is_not_accepted():
    bench = Told()
    bench.drive_warns = True
    bench.run(810)
    bench.order_is(acknowledge=True)
    bench.run(30)
    bench.tank = bench.tank._replace(port_high=Switch.ON)
    bench.run(300)
    assert [(event.code, event.state) for event in bench.told] == [
        (Fault.DRIVE_WARNING, ACTIVE),
        (Fault.DRIVE_WARNING, ACCEPTED),
        (HIGH, ACTIVE),
    ]
    assert bench.status.alarm


@pytest.mark.parametrize("mode", [Mode.STANDBY, Mode.PASSIVE])
def test_a_late_tick_that_was_accepted_hides_no_stall_of_the_loop(mode):
    bench = Told()
    bench.order_is(mode_request=mode)
    bench.run(1000)
    bench.tick(late_ticks=1)
    bench.run(400)
    bench.accept()
    bench.tick(late_ticks=5)
    bench.run(120)
    assert [(event.code, event.state) for event in bench.told] == [(Fault.OVERRUN, ACTIVE)]


@pytest.mark.parametrize("mode", [Mode.STANDBY, Mode.PASSIVE])
@pytest.mark.parametrize("phase_ms", range(0, 100, 20))
def test_a_bus_that_was_off_for_a_moment_alarms_and_the_drive_stays_off(mode, phase_ms):
    bench = Told()
    bench.run(1000)
    bench.order_is(mode_request=mode)
    bench.run(1000 + phase_ms)
    assert bench.node.mode is mode
    bench.node.link_error(bench.now_ns, "bus-off")
    bench.run(300)
    assert [(event.code, event.state) for event in bench.told] == [(Fault.BUS_LOST, ACTIVE)]
    assert bench.node.mode is Mode.STANDBY
    assert not bench.node.safety.supervisor.drive_wanted


def test_a_second_trip_by_the_same_fault_alarms_though_the_first_is_accepted():
    bench = Told()
    bench.drive_at(10e3)
    bench.drive_fault = DriveFault.STALL
    bench.run(300)
    bench.accept()
    bench.drive_fault = DriveFault.NONE
    bench.order_is(mode_request=Mode.STANDBY, arm=False, reset=True)
    bench.run(300)
    bench.order_is(reset=False)
    bench.arm()
    bench.drive_fault = DriveFault.STALL
    bench.run(300)
    assert (bench.node.mode, bench.status.alarm) == (Mode.FAULT, True)
    assert [(e.code, e.state, e.mode) for e in bench.told] == [
        (Fault.DRIVE_FAULT, ACTIVE, Mode.FAULT)
    ]


def halved_and_accepted():
    """In charge with half the pressure, without gauges, whose alarm is accepted."""
    bench = Told()
    bench.drive_at(10e3)
    bench.silent.add(type(bench.tank))
    bench.run(400)
    bench.accept()
    return bench


def test_what_halved_the_pressure_and_was_accepted_alarms_again_when_it_ends_control():
    bench = halved_and_accepted()
    bench.run(1000)
    assert (bench.node.mode, bench.status.alarm) == (Mode.FAULT, True)
    assert [(e.code, e.state, e.mode) for e in bench.told] == [(SILENT, ACTIVE, Mode.FAULT)]


def test_what_halved_the_pressure_and_was_accepted_alarms_again_when_it_keeps_from_arming():
    bench = halved_and_accepted()
    bench.silent.clear()
    bench.order_is(mode_request=Mode.STANDBY, arm=False)
    bench.run(500)
    assert (bench.node.mode, bench.told) == (Mode.STANDBY, [])
    bench.silent.add(type(bench.tank))
    bench.run(400)
    assert [(e.code, e.state, e.mode) for e in bench.told] == [(SILENT, ACTIVE, Mode.INIT)]


def test_once_it_was_ready_a_second_thing_alarms_in_init_without_a_quiet_time():
    bench = Told()
    bench.run(1000)
    assert bench.node.mode is Mode.STANDBY
    bench.silent.add(type(bench.tank))
    bench.run(400)
    bench.drive_warns = True
    bench.run(300)
    assert bench.node.mode is Mode.INIT
    assert [event.code for event in bench.told] == [SILENT, Fault.DRIVE_WARNING]


def test_the_alarm_of_a_refused_arming_goes_and_hides_no_later_one():
    bench = Told()
    bench.tank = bench.tank._replace(port_high=Switch.ON)
    bench.run(400)
    bench.order_is(mode_request=Mode.ACTIVE, arm=True)
    bench.run(200)
    bench.tank = bench.tank._replace(port_high=Switch.OFF)
    bench.accept()
    bench.run(11_000)
    assert codes(bench) == {Fault.NONE}
    bench.told.clear()
    bench.tank = bench.tank._replace(port_high=Switch.ON)
    bench.run(200)
    assert [(event.code, event.state) for event in bench.told] == [(HIGH, ACTIVE)]
    # and each press of the lever that is refused is an event, with its cause accepted or not
    bench.accept()
    bench.order_is(mode_request=Mode.STANDBY, arm=False)
    bench.run(200)
    bench.order_is(mode_request=Mode.ACTIVE, arm=True)
    bench.run(120)
    assert [(event.code, event.state) for event in bench.told] == [(HIGH, ACTIVE)]


@pytest.mark.parametrize("mode", [Mode.STANDBY, Mode.PASSIVE, Mode.FAULT])
@pytest.mark.parametrize("phase_ms", range(0, 100, 10))
def test_a_switch_that_closes_between_two_statuses_alarms(mode, phase_ms):
    bench = Told()
    if mode is Mode.FAULT:
        bench.drive_at(10e3)
        bench.drive_fault = DriveFault.STALL
        bench.run(400)
        bench.accept()
    elif mode is Mode.PASSIVE:
        bench.run(100)
        bench.order_is(mode_request=Mode.PASSIVE)
    bench.run(1000 + phase_ms)
    assert bench.node.mode is mode
    bench.tank = bench.tank._replace(starboard_high=Switch.ON)
    bench.run(20)
    bench.tank = bench.tank._replace(starboard_high=Switch.OFF)
    bench.run(120)
    assert [(event.code, event.state) for event in bench.told] == [(HIGH, ACTIVE)]
    bench.run(11_000)
    assert [event.state for event in bench.told] == [ACTIVE, RECTIFIED]


@pytest.mark.parametrize("phase_ms", range(0, 100, 10))
def test_what_halves_the_pressure_between_two_statuses_alarms(phase_ms):
    bench = Told()
    bench.drive_at(10e3)
    bench.run(1000 + phase_ms)
    bench.silent = {SensorTank}
    bench.run(120)
    bench.silent = set()
    bench.run(200)
    assert bench.node.mode is Mode.ACTIVE
    assert [(event.code, event.state) for event in bench.told] == [(Fault.TANK_SILENT, ACTIVE)]


def test_what_is_latched_and_reset_between_two_statuses_alarms():
    bench = Told()
    bench.drive_at(10e3)
    while bench.ms % 100 != 10:
        bench.tick()
    bench.tank = bench.tank._replace(port_high=Switch.ON)
    bench.run(20)
    bench.tank = bench.tank._replace(port_high=Switch.OFF)
    bench.run(10)
    bench.order_is(mode_request=Mode.STANDBY, arm=False, reset=True)
    bench.run(40)
    assert bench.node.mode is Mode.STANDBY
    bench.run(100)
    assert [(e.code, e.state, e.mode) for e in bench.told] == [(HIGH, ACTIVE, Mode.FAULT)]


def test_what_refused_an_arming_is_an_alarm_as_long_as_it_would_refuse_another():
    bench = Told()
    bench.node.commissioned = False
    bench.run(400)
    bench.order_is(mode_request=Mode.ACTIVE, arm=True)
    bench.run(20_000)
    assert codes(bench) == {Fault.NOT_COMMISSIONED}
    assert [event.state for event in bench.told] == [ACTIVE]
    bench.node.commissioned = True
    bench.run(11_000)
    assert [event.state for event in bench.told] == [ACTIVE, RECTIFIED]


def test_an_alarm_is_raised_254_times_at_most_that_fit_its_byte():
    """255 is what is not available."""
    alarms = AlarmList()
    for times in range(1, 300):
        alarms.raise_anew(Fault.ROLL_AMPLIFIED, Mode.ACTIVE, 0)
        assert alarms.next_message(0)[4] == min(times, 254)
