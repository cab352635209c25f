"""Faults that keep every message intact: found from what the signals say, in the storm."""

import random
from collections import deque
from collections.abc import Callable, Iterable

import pytest
from fault_bench import CATALOGUE, MS, SECOND, FaultBench, Impostor, altered, doubled

from utank_hil.canbus import (
    Fault,
    Frame,
    Mode,
    Quality,
    SensorMotion,
    SensorTank,
)

T0_S = 40.0
T0 = round(T0_S * SECOND)
PERIOD_S = 10.7  # of the ship's roll
Prepare = Callable[[FaultBench], None]


def motion(change: Callable[[float, float], tuple[float, float]]) -> Prepare:
    """A motion sensor that sends something else than roll and rate."""

    def alter(message: SensorMotion) -> SensorMotion:
        roll_rad, rate_rad_s = change(message.roll_rad, message.roll_rate_rad_s)
        return message._replace(roll_rad=roll_rad, roll_rate_rad_s=rate_rad_s)

    return sensors(altered(SensorMotion, alter))


def tank(change: Callable[[float, float], tuple[float, float]]) -> Prepare:
    """Level gauges that send something else than the port and the starboard level."""

    def alter(message: SensorTank) -> SensorTank:
        port_m, starboard_m = change(message.port_level_m, message.starboard_level_m)
        return message._replace(port_level_m=port_m, starboard_level_m=starboard_m)

    return sensors(altered(SensorTank, alter))


def sensors(spoil: Callable[[Frame], Iterable[Frame]]) -> Prepare:
    def prepare(bench: FaultBench) -> None:
        bench.sensors.begin_ns, bench.sensors.spoil = T0, spoil

    return prepare


def stuck_motion(*, roll: bool, rate: bool) -> Prepare:
    held: list[tuple[float, float]] = []

    def change(roll_rad: float, rate_rad_s: float) -> tuple[float, float]:
        held.append((roll_rad, rate_rad_s))
        return held[0][0] if roll else roll_rad, held[0][1] if rate else rate_rad_s

    return motion(change)


def stuck_levels() -> Prepare:
    held: list[tuple[float, float]] = []

    def change(port_m: float, starboard_m: float) -> tuple[float, float]:
        held.append((port_m, starboard_m))
        return held[0]

    return tank(change)


def noisy(times: float) -> Prepare:
    draw = random.Random(1).gauss
    return motion(lambda roll, rate: (roll + draw(0, times * 2e-4), rate + draw(0, times * 5e-4)))


def drifting(rad_min: float) -> Prepare:
    drift = [0.0]

    def change(roll_rad: float, rate_rad_s: float) -> tuple[float, float]:
        drift[0] += rad_min / 60 * 0.01
        return roll_rad + drift[0], rate_rad_s

    return motion(change)


def delayed(seconds: float) -> Prepare:
    """A sensor that has always been late: the line is full when the fault is looked at."""
    line: deque[tuple[float, float]] = deque(maxlen=round(seconds / 0.01) + 1)

    def change(roll_rad: float, rate_rad_s: float) -> tuple[float, float]:
        line.append((roll_rad, rate_rad_s))
        return line[0]

    def prepare(bench: FaultBench) -> None:
        motion(change)(bench)
        bench.sensors.begin_ns = 0

    return prepare


def pump(pressure: Callable[[float], float]) -> Prepare:
    """A pump that makes another pressure than the drive asks it for, and measures it rightly."""

    def prepare(bench: FaultBench) -> None:
        plant, drive_pump = bench.ship.plant, bench.ship.plant.drive_pump

        def broken(setpoint_pa: float, *, enabled: bool) -> None:
            if enabled and bench.lockstep.now_ns >= T0:
                plant.impose_pressure(pressure(setpoint_pa))
            else:
                drive_pump(setpoint_pa, enabled=enabled)

        plant.drive_pump = broken  # type: ignore[method-assign]

    return prepare


def skipping(step: int) -> Prepare:
    return sensors(altered(SensorMotion, lambda message: message, counter_step=step))


def inserting(back: int) -> Prepare:
    """Frames of the motion sensor of some cycles ago, one beside each new one."""
    old: deque[Frame] = deque(maxlen=back)
    can_id = CATALOGUE.receiver(SensorMotion).can_id

    def insert(frame: Frame) -> Iterable[Frame]:
        if frame.can_id != can_id:
            return (frame,)
        old.append(frame)
        return frame, old[0]

    return sensors(insert)


def replaying(frames: int) -> Prepare:
    """The motion sensor's last frames over and over, in the place of the new ones."""
    kept: list[Frame] = []
    count = [0]
    can_id = CATALOGUE.receiver(SensorMotion).can_id

    def replay(frame: Frame) -> Iterable[Frame]:
        if frame.can_id != can_id:
            return (frame,)
        if len(kept) < frames:
            kept.append(frame)
            return (frame,)
        count[0] += 1
        return (kept[(count[0] - 1) % frames],)

    return sensors(replay)


MOTION = {Fault.MOTION_SILENT, Fault.DRIFT, Fault.STUCK_SIGNAL, Fault.SPIKES}
SIGN = {Fault.MOTION_SIGN_FLIP, Fault.MOTION_SILENT, Fault.DRIFT}
LEVELS = {Fault.STUCK_SIGNAL, Fault.MOTION_SIGN_FLIP, Fault.SPIKES}
PUMP = {Fault.DRIVE_NOT_FOLLOWING, Fault.SIGN_FLIP}
SENDER = {Fault.FOREIGN_SENDER, Fault.MOTION_SILENT}

# what happens, what it is called at the end, by when; None: its pressure is halved, nothing more
FAULTS: dict[str, tuple[Prepare, set[Fault] | None, float]] = {
    "sign of roll": (motion(lambda roll, rate: (-roll, rate)), SIGN, 1.0),
    "sign of rate": (motion(lambda roll, rate: (roll, -rate)), SIGN, 1.0),
    "roll stuck": (stuck_motion(roll=True, rate=False), {Fault.STUCK_SIGNAL, Fault.DRIFT}, 3.0),
    "rate stuck": (stuck_motion(roll=False, rate=True), {Fault.STUCK_SIGNAL, Fault.DRIFT}, 2.0),
    "both stuck": (stuck_motion(roll=True, rate=True), {Fault.STUCK_SIGNAL, Fault.DRIFT}, 3.0),
    "noise x 10": (noisy(10), None, 2.0),
    "noise x 100": (noisy(100), MOTION, 2.0),
    "drift 0.1 rad/min": (drifting(0.1), {Fault.DRIFT, Fault.STUCK_SIGNAL}, 30.0),
    "drift 0.01 rad/min": (drifting(0.01), None, 30.0),
    "levels swapped": (tank(lambda port, starboard: (starboard, port)), LEVELS, PERIOD_S),
    "levels stuck": (stuck_levels(), LEVELS, 5.0),
    "levels zero, switches open": (tank(lambda *_: (0.0, 0.0)), LEVELS, 5.0),
    "pump stalled": (pump(lambda _: 0.0), PUMP, 3.0),
    "pump stuck at 50 kPa": (pump(lambda _: 50e3), PUMP, 1.0),
    "pump reversed": (pump(lambda pressure_pa: -pressure_pa), PUMP, 1.0),
    "counter skips": (skipping(4), SENDER, 0.5),
    "old frames inserted": (inserting(24), SENDER, 0.5),
    "frames sent twice": (sensors(doubled), SENDER, 0.5),
    "replay of 1.6 s": (replaying(160), MOTION | SIGN, 10.0),
    "replay of 160 ms": (replaying(16), MOTION | SIGN, 10.0),
}


def found_by(bench: FaultBench, until_s: float, step_s: float = 0.1) -> float | None:
    """When the controller reacted, after T0."""
    time_s = T0_S
    while time_s < until_s:
        time_s += step_s
        bench.run(time_s)
        if bench.mode is Mode.FAULT or bench.node.supervisor.degraded:
            return time_s - T0_S
    return None


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_fault_that_no_message_shows_is_found_in_time(name: str) -> None:
    prepare, faults, within_s = FAULTS[name]
    bench = FaultBench()
    prepare(bench)
    bench.run(T0_S)
    assert bench.mode is Mode.ACTIVE
    found_s = found_by(bench, T0_S + within_s)
    assert found_s is not None
    if faults is None:
        assert bench.mode is Mode.ACTIVE
    else:
        bench.run(T0_S + within_s + 1.1)
        assert bench.mode is Mode.FAULT
        assert bench.node.fault in faults
        assert bench.pressure_at_zero_since(round((T0_S + within_s + 1.1) * SECOND) - 50 * MS)


@pytest.mark.slow
def test_both_signs_of_the_motion_sensor_wrong_from_the_start_are_found() -> None:
    """A sensor mounted the wrong way round: nothing jumps, only the water tells."""
    bench = FaultBench()
    motion(lambda roll, rate: (-roll, -rate))(bench)
    bench.sensors.begin_ns = 0
    bench.run(10.0 + 2 * PERIOD_S)
    assert (bench.mode, bench.node.fault) == (Mode.FAULT, Fault.MOTION_SIGN_FLIP)


@pytest.mark.slow
@pytest.mark.parametrize(("seconds", "found"), [(2.0, True), (0.1, False)])
def test_motion_sensor_two_seconds_late_is_found_and_100_ms_late_is_not(
    seconds: float, found: bool
) -> None:
    bench = FaultBench()
    delayed(seconds)(bench)
    bench.run(90.0)
    assert (bench.mode is Mode.FAULT) is found
    assert bench.node.fault in ({Fault.SIGNAL_DELAYED, Fault.MOTION_SIGN_FLIP} if found else {0})


@pytest.mark.slow
def test_one_spike_is_discarded_and_nobody_is_troubled() -> None:
    spiked, clean = FaultBench(), FaultBench()
    motion(lambda roll, rate: (roll + 0.5, rate))(spiked)
    spiked.sensors.end_ns = T0 + 10 * MS
    for bench in (spiked, clean):
        bench.run(T0_S + 5)
    assert spiked.mode is Mode.ACTIVE
    assert not spiked.node.supervisor.degraded
    assert spiked.ship.plant.roll_rad == pytest.approx(clean.ship.plant.roll_rad, abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("counter", [1, 2, 3, 4, 9])
def test_second_sender_of_the_motion_sensor_is_found_whatever_its_counter(counter: int) -> None:
    impostor = Impostor(SensorMotion(0.0, 0.0, Quality.GOOD), T0, counter)
    bench = FaultBench(extra=[impostor])
    bench.run(T0_S)
    assert bench.mode is Mode.ACTIVE
    bench.run(T0_S + 0.5)
    assert bench.mode is Mode.FAULT
