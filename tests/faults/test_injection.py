"""Each kind of fault does on the bus what it says, and nothing else."""

import math
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest
from pydantic import TypeAdapter, ValidationError

from firmware_sim.bench import jobs_of
from firmware_sim.fault_injection.kinds import AnyFault
from firmware_sim.faulty_bench import FaultyBench
from firmware_sim.run import run_lockstep
from firmware_sim.scenario import Scenario
from firmware_sim.scenario_problems import missing_nodes
from firmware_sim.ship_side import build_ship_side
from utank_hil.assembly import build_controller_node, build_law
from utank_hil.canbus import (
    Fault,
    Frame,
    Mode,
    OperatorCommand,
    SensorMotion,
    SensorTank,
    load_catalogue,
)
from utank_hil.configuration import load_config
from utank_hil.configuration.files import problems_in_words
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.runners import Lockstep

pytestmark = pytest.mark.slow

CATALOGUE = load_catalogue()
MOTION, TANK = CATALOGUE.codec(SensorMotion), CATALOGUE.codec(SensorTank)
SECOND = 1_000_000_000
FAULT_S = 2.0
END_S = 2.5


@cache
def storm():
    return load_config(Path("configs/scenarios/storm.yaml"), Scenario)


@cache
def law():
    return build_law(storm().controllers["gpc"])


class Bus:
    """A bench with faults at `FAULT_S`, and all that was on its bus."""

    def __init__(self, *faults):
        self.heard: list[tuple[int, str, Frame]] = []
        self.bench = FaultyBench(
            storm(), storm().controllers["gpc"], law(), seed=1,
            script=(TimedAction(1.0, Action.ARM),), trace=lambda *heard: self.heard.append(heard),
        )  # fmt: skip
        self.bench.run(round(FAULT_S * SECOND))
        self.bench.place([TypeAdapter(AnyFault).validate_python(each) for each in faults])
        self.bench.run(round(END_S * SECOND))

    def of(self, codec, *, before=False):
        """Frames of a message since the fault, or before it."""
        return [
            frame
            for time_ns, _, frame in self.heard
            if frame.can_id == codec.can_id and (time_ns < FAULT_S * SECOND) is before
        ]

    def said(self, codec, signal):
        """Values of a signal since the fault."""
        return [getattr(codec.decode(frame.data), signal) for frame in self.of(codec)]


@cache
def sound():
    return Bus()


def counters(frames):
    return [(b.data[1] - a.data[1]) & 15 for a, b in pairwise(frames)]


def test_without_faults_the_bench_is_the_plain_one():
    assert len(sound().of(MOTION)) == 50
    assert set(counters(sound().of(MOTION))) == {1}
    assert sound().bench.node.mode is Mode.ACTIVE


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ({"kind": "stuck"}, lambda k, true, first: first),
        ({"kind": "offset", "by": 0.01}, lambda k, true, first: true + 0.01),
        ({"kind": "scale", "times": 1.5}, lambda k, true, first: true * 1.5),
        ({"kind": "drift", "by_per_s": 0.1}, lambda k, true, first: true + 0.001 * k),
        ({"kind": "sign"}, lambda k, true, first: -true),
        ({"kind": "spikes", "by": 0.02, "every": 10},
         lambda k, true, first: true + 0.02 * (k % 10 == 0)),
    ],
)  # fmt: skip
def test_a_signal_is_wrong_as_stated_in_frames_that_are_intact(fault, expected):
    bus = Bus({**fault, "message": "SENSOR_MOTION", "signals": ["roll_rad"]})
    true, shown = sound().said(MOTION, "roll_rad"), bus.said(MOTION, "roll_rad")
    for k, (right, wrong) in enumerate(zip(true, shown, strict=True)):
        if k < 5:  # before the controller has answered, the ship is the same
            assert wrong == pytest.approx(expected(k, right, true[0]), abs=1.1e-4)
    assert set(counters(bus.of(MOTION))) == {1}
    assert bus.said(MOTION, "roll_rate_rad_s")[:5] == sound().said(MOTION, "roll_rate_rad_s")[:5]


def test_late_swapped_noisy_and_missing_values():
    late = Bus({"kind": "late", "message": "SENSOR_MOTION", "signals": ["roll_rad"], "by_s": 0.2})
    assert late.said(MOTION, "roll_rad")[20:25] == late.said(MOTION, "roll_rad")[20:21] + sound(
    ).said(MOTION, "roll_rad")[1:5]  # fmt: skip
    swapped = Bus({"kind": "swapped", "message": "SENSOR_TANK",
                   "signals": ["port_level_m", "starboard_level_m"]})  # fmt: skip
    assert swapped.said(TANK, "port_level_m")[:2] == sound().said(TANK, "starboard_level_m")[:2]
    noisy = Bus({"kind": "noise", "message": "SENSOR_TANK", "signals": ["port_level_m"],
                 "deviation": 0.5})  # fmt: skip
    apart = [a - b for a, b in zip(noisy.said(TANK, "port_level_m"),
                                   sound().said(TANK, "port_level_m"), strict=True)]  # fmt: skip
    assert 0.25 < math.sqrt(sum(each * each for each in apart) / len(apart)) < 0.9
    missing = Bus({"kind": "value", "message": "SENSOR_TANK", "values": {"port_level_m": None}})
    assert all(math.isnan(each) for each in missing.said(TANK, "port_level_m"))


@pytest.mark.parametrize(
    ("fault", "steps", "intact"),
    [
        ({"kind": "counter", "step": 4}, {4}, True),
        ({"kind": "counter", "step": 0}, {0}, True),
        ({"kind": "counter", "step": 1, "one_of": 5}, {1}, True),
        ({"kind": "frozen"}, {0}, True),
        ({"kind": "corrupted"}, {1}, False),
        ({"kind": "data_id"}, {1}, False),
        ({"kind": "replayed", "frames": 5}, {1, 12}, True),
        ({"kind": "doubled"}, {0, 1}, True),
        ({"kind": "inserted", "back": 3}, {4, 13}, True),
    ],
)
def test_frames_are_spoiled_as_stated(fault, steps, intact):
    frames = Bus({**fault, "message": "SENSOR_MOTION"}).of(MOTION)
    assert set(counters(frames[4:])) == steps
    assert all((MOTION.decode(frame.data) is not None) is intact for frame in frames)


@pytest.mark.parametrize(
    ("fault", "count"),
    [
        ({"kind": "lost", "message": "SENSOR_MOTION", "for_s": 0.1}, 40),
        ({"kind": "counter", "step": 1, "one_of": 5, "message": "SENSOR_MOTION"}, 10),
        ({"kind": "mute", "node": "sensors"}, 0),
        ({"kind": "hangs", "node": "sensors", "at_s": 0.2}, 20),
        ({"kind": "gateway", "does": "loses", "message": "SENSOR_MOTION"}, 0),
        ({"kind": "gateway", "does": "doubles", "message": "SENSOR_MOTION"}, 100),
        ({"kind": "gateway", "does": "delays", "message": "SENSOR_MOTION", "by_s": 0.105}, 39),
    ],
)
def test_frames_are_lost_doubled_and_delayed(fault, count):
    assert len(Bus(fault).of(MOTION)) == pytest.approx(count, abs=1)


def test_a_gateway_swaps_frames_of_one_identifier():
    swapped = Bus({"kind": "gateway", "does": "swaps", "message": "SENSOR_MOTION"})
    assert set(counters(swapped.of(MOTION))) == {3, 15}


def test_wrong_length_is_on_the_wire():
    bus = Bus({"kind": "length", "message": "SENSOR_MOTION", "length": 3})
    assert {len(frame.data) for frame in bus.of(MOTION)} == {3}


def test_bit_errors_cost_time_on_the_bus_and_no_frame():
    bus = Bus({"kind": "bit_errors", "share": 0.1})
    assert len(bus.of(MOTION)) == len(sound().of(MOTION))
    loads = [each.bench.bus.load(round(END_S * SECOND)) for each in (bus, sound())]
    assert loads[0] > loads[1]
    assert 0 < max(bus.bench.bus.error_counts.values()) < 128


def test_broken_transceiver_is_passive_then_off_and_comes_back():
    told: list[str] = []
    bus = Bus()
    bench = bus.bench
    bench.nodes["controller"].link_error = lambda _, why: told.append(why)
    bench.place([TypeAdapter(AnyFault).validate_python(
        {"kind": "bit_errors", "share": 1.0, "node": "controller", "for_s": 0.5})])  # fmt: skip
    bench.run(round((END_S + 0.6) * SECOND))
    assert told[0] == "error-passive on sending"
    assert set(told[1:]) == {"bus-off"}
    sent = [t for t, sender, _ in bus.heard if sender == "controller" and t > END_S * SECOND]
    assert min(sent) >= (END_S + 0.5) * SECOND


def test_faults_of_a_scenario_are_in_its_runs_but_for_the_passive_one():
    lost = TypeAdapter(AnyFault).validate_python(
        {"kind": "lost", "message": "SENSOR_MOTION", "at_s": 7.0}
    )
    scenario = storm().model_copy(
        update={"faults": (lost,), "controllers": {"gpc": storm().controllers["gpc"]}}
    )
    ended = {}
    for job in jobs_of(scenario, 1, 8.0, {"gpc": law()}):
        run = run_lockstep(job)
        ended[run.name] = (Mode(int(run.column("mode")[-1])), Fault(int(run.column("fault")[-1])))
        assert run.end_s == pytest.approx(8.0)
    assert ended == {
        "passive": (Mode.PASSIVE, Fault.NONE),
        "gpc": (Mode.FAULT, Fault.MOTION_SILENT),
    }


def test_a_bench_without_faults_has_the_frames_of_the_plain_one():
    heard: list[tuple[int, str, Frame]] = []
    ship = build_ship_side(storm(), 1, (TimedAction(1.0, Action.ARM),))
    node = build_controller_node(storm().controllers["gpc"], law(), commissioned=True)
    Lockstep([*ship.nodes, node], trace=lambda *each: heard.append(each)).run_until(
        round(END_S * SECOND)
    )
    assert heard == sound().heard


@pytest.mark.parametrize("form", ["extended", "standard", "remote"])
def test_flood_takes_its_share_of_the_bus(form):
    bus = Bus({"kind": "flood", "identifier": "7FF", "share": 0.5, "format": form})
    at_ns = round(END_S * SECOND)
    busy_s = [each.bench.bus.load(at_ns) * END_S for each in (bus, sound())]
    assert busy_s[0] - busy_s[1] == pytest.approx(0.25, abs=0.03)
    assert bus.bench.node.inbox.foreign > 100


def test_pump_drive_law_and_operator_fail():
    stalled = Bus({"kind": "pump", "times": 0.0}).bench
    assert stalled.ship.plant.pressure_pa == 0.0 != sound().bench.ship.plant.pressure_pa
    assert not Bus({"kind": "drive", "fault": "OVERCURRENT"}).bench.ship.drive.enabled
    assert "injected" in Bus({"kind": "law", "fails": "raises"}).bench.node.law.error
    assert "nan" in Bus({"kind": "law", "fails": "answers_nan"}).bench.node.law.error
    restarted = Bus({"kind": "killed", "for_s": 0.2}).bench
    assert restarted.node.mode in (Mode.INIT, Mode.STANDBY)
    panel = Bus({"kind": "second_panel", "operator": [{"time_s": 0.0, "action": "stop"}]})
    assert panel.bench.node.mode is Mode.STANDBY
    other = CATALOGUE.named("OPERATOR_CMD_2").codec
    assert any(other.decode(frame.data).stop for frame in panel.of(other))


def test_a_second_panel_comes_and_goes_when_its_fault_says():
    bus = Bus({"kind": "second_panel", "at_s": 0.1, "for_s": 0.25})
    own = CATALOGUE.named("OPERATOR_CMD_2").codec.can_id
    times_s = [time_ns / SECOND for time_ns, _, frame in bus.heard if frame.can_id == own]
    assert FAULT_S + 0.1 <= min(times_s) < FAULT_S + 0.15
    assert FAULT_S + 0.3 <= max(times_s) < FAULT_S + 0.35


@pytest.mark.parametrize(
    "fault",
    [
        {"kind": "bit_errors", "share": 1.0, "node": "valve"},
        {"kind": "gateway", "does": "loses", "message": "VALVE_STATUS"},
        {"kind": "gateway", "does": "loses", "message": "HARDWIRED_INPUTS"},
    ],
)
def test_a_fault_of_the_bus_that_needs_a_node_the_ship_has_not_is_refused(fault):
    assert missing_nodes(storm().vessel, [TypeAdapter(AnyFault).validate_python(fault)])
    fine = fault | ({"node": "sensors"} if "node" in fault else {"message": "SENSOR_TANK"})
    assert not missing_nodes(storm().vessel, [TypeAdapter(AnyFault).validate_python(fine)])


def placed(*faults, until_s, arm_s=None):
    """A bench with faults from the start."""
    script = () if arm_s is None else (TimedAction(arm_s, Action.ARM),)
    bench = FaultyBench(storm(), storm().controllers["gpc"], law(), seed=1, script=script)
    bench.place([TypeAdapter(AnyFault).validate_python(each) for each in faults])
    bench.run(round(until_s * SECOND))
    return bench


@pytest.mark.parametrize("fails_s", [0.1, 2.0], ids=["killed while it fails", "killed before"])
def test_a_law_fails_in_a_controller_that_was_started_anew(fails_s):
    killed = {"kind": "killed", "at_s": 0.2, "for_s": 0.2}
    failing = {"kind": "law", "fails": "raises", "at_s": fails_s, "for_s": 3.0}
    bench = placed(killed, failing, arm_s=1.5, until_s=2.5)
    assert "injected" in bench.node.law.error
    assert bench.node.fault is Fault.INTERNAL


def test_a_law_whose_fault_is_over_when_it_is_started_anew_is_sound():
    killed = {"kind": "killed", "at_s": 0.2, "for_s": 0.2}
    failing = {"kind": "law", "fails": "raises", "at_s": 0.1, "for_s": 0.25}
    bench = placed(killed, failing, arm_s=1.5, until_s=2.5)
    assert bench.node.law.error == ""
    assert bench.node.mode is Mode.ACTIVE


def test_a_pump_fails_between_its_own_times_whatever_other_faults_it_has():
    first = {"kind": "pump", "plus_pa": 8000.0, "off_too": True, "at_s": 0.2, "for_s": 0.5}
    second = {"kind": "pump", "times": 0.5, "at_s": 1.0}
    bench = placed(first, second, until_s=0.1)
    plant = bench.ship.plant
    off_pa = plant.pressure_pa
    for until_s, pressure_pa in ((0.5, 8000.0), (0.9, off_pa), (1.5, off_pa)):
        bench.run(round(until_s * SECOND))
        assert plant.pressure_pa == pytest.approx(pressure_pa, abs=500.0)
    # the end of one is not the end of another that has begun since
    overlapping = placed(second, {**first, "at_s": 1.1}, {**second, "for_s": 0.2}, until_s=1.3)
    assert overlapping.ship.plant.pressure_pa == pytest.approx(8000.0)


def test_a_sender_that_is_off_the_bus_comes_back_when_the_fault_at_hand_is_over():
    errors = {"kind": "bit_errors", "share": 1.0, "node": "sensors", "for_s": 0.3}
    bus = Bus({**errors, "at_s": 0.05}, {**errors, "at_s": 50.0})
    sent_s = [time_ns / SECOND - FAULT_S for time_ns, by, _ in bus.heard if by == "sensors"]
    assert min((each for each in sent_s if each > 0.15), default=END_S) == pytest.approx(
        0.35, abs=0.02
    )


@pytest.mark.parametrize(
    ("by_s", "period_s", "late_s"), [(0.001, 0.01, 0.01), (0.025, 0.01, 0.03), (0.03, 0.01, 0.03)]
)
def test_a_delay_is_never_shorter_than_stated(by_s, period_s, late_s):
    late = Bus({"kind": "late", "message": "SENSOR_MOTION", "signals": ["roll_rad"], "by_s": by_s})
    shift = round(late_s / period_s)
    true, shown = sound().said(MOTION, "roll_rad"), late.said(MOTION, "roll_rad")
    assert shown[: shift + 3] == [true[0]] * shift + true[:3]


def test_an_impostor_sends_beside_the_sender():
    values = {"mode_request": "STANDBY", "arm": False, "stop": True, "reset": False,
              "acknowledge": False}  # fmt: skip
    bus = Bus({"kind": "impostor", "message": "OPERATOR_CMD", "values": values})
    stops = [CATALOGUE.codec(OperatorCommand).decode(f.data).stop
             for f in bus.of(CATALOGUE.codec(OperatorCommand))]  # fmt: skip
    assert set(stops) == {True, False}
    assert bus.bench.node.mode is not Mode.ACTIVE


@pytest.mark.parametrize(
    ("written", "key", "words"),
    [
        ({"kind": "stuk", "message": "SENSOR_MOTION"}, "faults.0", "did you mean stuck"),
        ({"kind": "sign", "message": "SENSOR_MOTON", "signals": ["roll_rad"]},
         "faults.0.message", "did you mean SENSOR_MOTION"),
        ({"kind": "sign", "message": "SENSOR_MOTION", "signals": ["rol_rad"]},
         "faults.0.signals.0", "is no signal of SENSOR_MOTION"),
        ({"kind": "noise", "message": "SENSOR_MOTION", "signals": ["quality"], "deviation": 1.0},
         "faults.0.signals.0", "is no measured quantity"),
        ({"kind": "value", "message": "SENSOR_MOTION", "values": {"quality": "FINE"}},
         "faults.0.values.quality", "must be one of GOOD"),
        ({"kind": "hangs", "node": "senors"}, "faults.0.node", "did you mean sensors"),
        ({"kind": "hangs", "node": "valve"}, "faults.0", "the vessel has no valve"),
        ({"kind": "flood", "identifier": "8FF1080x", "share": 0.5},
         "faults.0.identifier", "must be a hexadecimal identifier"),
        ({"kind": "impostor", "message": "SENSOR_MOTION", "values": {}},
         "faults.0.values.roll_rad", "is required but missing"),
        ({"kind": "gateway", "does": "delays"}, "faults.0.by_s", "delays"),
        ({"kind": "lost", "message": "SENSOR_MOTION", "at_s": -1.0},
         "faults.0.at_s", "must be 0 to 86400"),
        ({"kind": "mute", "node": "sensors", "at_s": 1e300},
         "faults.0.at_s", "must be 0 to 86400"),
        ({"kind": "mute", "node": "sensors", "for_s": 1e300},
         "faults.0.for_s", "must be above 0 and at most 86400"),
        ({"kind": "late", "message": "SENSOR_MOTION", "signals": ["roll_rad"], "by_s": 1e300},
         "faults.0.by_s", "must be above 0 and at most 86400"),
        ({"kind": "gateway", "does": "delays", "by_s": 1e300},
         "faults.0.by_s", "must be above 0 and at most 86400"),
        ({"kind": "inserted", "message": "SENSOR_MOTION", "back": 10**30},
         "faults.0.back", "must be 1 to 10000"),
        ({"kind": "value", "message": "SENSOR_MOTION", "values": {"quality": 255}},
         "faults.0.values.quality", "must be 0 to 15"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_at_its_key(written, key, words):
    content = dict(storm()) | {"faults": [written]}  # the rest is checked already
    with pytest.raises(ValidationError) as caught:
        Scenario.model_validate(content)
    found = problems_in_words(caught.value, content, Scenario)
    assert any(
        ".".join(map(str, at)).startswith(key) and words in reason for at, reason in found
    ), found
