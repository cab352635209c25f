import math
from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest
from drive_bench import CATALOGUE, VESSEL

from firmware_sim.plant import Plant
from firmware_sim.scenario_sections import SensorErrors
from firmware_sim.sensors import SensorNode
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import (
    Address,
    Frame,
    Heartbeat,
    Quality,
    SensorMotion,
    SensorPump,
    SensorTank,
    Switch,
)
from utank_hil.sea import Harmonics

SWELL = Harmonics(np.array([6e7]), np.array([0.6]), np.array([0.4]))
EXACT = SensorErrors(0.0, 0.0, 0.0, 0.0, 0.0)
# half a step of the DBC
ROLL_STEP_RAD, RATE_STEP_RAD_S, LEVEL_STEP_M, PRESSURE_STEP_PA = 1e-4, 3.125e-5, 1e-3, 8.0


class SensorBench:
    """A sensor node on a ship in a swell, everything it sends decoded."""

    def __init__(self, errors: SensorErrors, seed: int = 1) -> None:
        self.plant = Plant(VESSEL.ship, VESSEL.tank, VESSEL.pump, SWELL)
        self.node = SensorNode(self.plant, errors, CATALOGUE, configuration_version=5, seed=seed)
        self._receivers = {
            receiver.can_id: receiver
            for receiver in (
                CATALOGUE.receiver(SensorMotion),
                CATALOGUE.receiver(SensorTank),
                CATALOGUE.receiver(SensorPump),
                CATALOGUE.receiver(Heartbeat, Address.SENSORS),
            )
        }
        self.heard: defaultdict[type, list] = defaultdict(list)
        self.times_ns: defaultdict[type, list[int]] = defaultdict(list)
        self.truth: list[tuple[float, ...]] = []
        self.frames: list[Frame] = []

    def run(self, ticks: int, start_ns: int = 0) -> None:
        plant = self.plant
        for tick in range(ticks):
            now_ns = start_ns + tick * TICK_NS
            frames = list(self.node.tick(now_ns))
            self.frames += frames
            self.truth.append(
                (plant.roll_rad, plant.roll_rate_rad_s, plant.level_m, plant.pressure_pa)
            )
            for frame in frames:
                receiver = self._receivers.get(frame.can_id)
                if receiver is not None:
                    message = receiver.accept(frame)
                    assert message is not None
                    self.heard[type(message)].append(message)
                    self.times_ns[type(message)].append(now_ns)

    def column(self, message: type, field: str) -> np.ndarray:
        return np.array([getattr(one, field) for one in self.heard[message]])

    def true(self, index: int) -> np.ndarray:
        return np.array(self.truth)[:, index]


def test_exact_sensors_differ_from_the_truth_by_quantization_only() -> None:
    bench = SensorBench(EXACT)
    bench.run(3000)
    for field, index, step in (
        ("roll_rad", 0, ROLL_STEP_RAD),
        ("roll_rate_rad_s", 1, RATE_STEP_RAD_S),
    ):
        error = bench.column(SensorMotion, field) - bench.true(index)
        assert np.abs(error).max() <= step / 2 * (1 + 1e-9)
        # a signal that moves through many steps: uniform error, variance step^2 / 12
        assert error.std() == pytest.approx(step / math.sqrt(12), rel=0.1)
    starboard = bench.column(SensorTank, "starboard_level_m") - bench.true(2)[::2]
    port = bench.column(SensorTank, "port_level_m") + bench.true(2)[::2]
    pressure = bench.column(SensorPump, "pressure_pa") - bench.true(3)[::2]
    assert np.abs(starboard).max() <= LEVEL_STEP_M / 2 * (1 + 1e-9)
    assert np.abs(port).max() <= LEVEL_STEP_M / 2 * (1 + 1e-9)
    assert np.abs(pressure).max() <= PRESSURE_STEP_PA / 2 * (1 + 1e-9)
    assert np.abs(bench.true(2)).max() > 1.0


def test_a_flow_that_the_bus_can_not_say_is_not_available() -> None:
    bench = SensorBench(EXACT)
    bench.run(2)
    bench.plant.flow_m3_s = 30.5  # stays, as no time passes
    bench.run(1, TICK_NS)
    told, not_told = bench.column(SensorPump, "flow_m3_s")
    assert told == pytest.approx(0.0, abs=1e-3)
    assert math.isnan(not_told)


@pytest.mark.parametrize("delay_ms", [0, 10, 20, 50])
def test_motion_is_as_old_as_the_delay_says_and_the_tank_is_not(delay_ms: int) -> None:
    bench = SensorBench(SensorErrors(0.0, 0.0, float(delay_ms), 0.0, 0.0))
    bench.run(1000)
    late = delay_ms // 10
    sent = bench.column(SensorMotion, "roll_rate_rad_s")[late:]
    np.testing.assert_allclose(sent, bench.true(1)[: 1000 - late], rtol=0, atol=RATE_STEP_RAD_S)
    assert (np.abs(bench.column(SensorMotion, "roll_rate_rad_s")[:late]) < 1e-4).all()
    levels = bench.column(SensorTank, "starboard_level_m")
    np.testing.assert_allclose(levels, bench.true(2)[::2], rtol=0, atol=LEVEL_STEP_M)


def test_roll_is_off_by_the_bias_and_nothing_else_is() -> None:
    straight, askew = SensorBench(EXACT), SensorBench(replace(EXACT, roll_bias_rad=0.035))
    for bench in (straight, askew):
        bench.run(500)
    off = askew.column(SensorMotion, "roll_rad") - straight.column(SensorMotion, "roll_rad")
    np.testing.assert_allclose(off, 0.035, rtol=0, atol=ROLL_STEP_RAD)
    for message, field in (
        (SensorMotion, "roll_rate_rad_s"),
        (SensorTank, "starboard_level_m"),
        (SensorPump, "pressure_pa"),
    ):
        same = straight.column(message, field)
        np.testing.assert_array_equal(askew.column(message, field), same)


def test_noise_is_white_and_as_large_as_configured() -> None:
    errors = SensorErrors(2e-3, 5e-3, 0.0, 0.02, 900.0)
    bench = SensorBench(errors)
    bench.run(8000)
    samples = {
        2e-3: bench.column(SensorMotion, "roll_rad") - bench.true(0),
        5e-3: bench.column(SensorMotion, "roll_rate_rad_s") - bench.true(1),
        0.02: bench.column(SensorTank, "starboard_level_m") - bench.true(2)[::2],
        900.0: bench.column(SensorPump, "pressure_pa") - bench.true(3)[::2],
    }
    for std, noise in samples.items():
        count = len(noise)
        # three standard errors of a Gaussian sample's deviation, mean and correlation
        assert noise.std() == pytest.approx(std, rel=3 / math.sqrt(2 * count))
        assert abs(noise.mean()) < 3 * std / math.sqrt(count)
        neighbours = np.corrcoef(noise[:-1], noise[1:])[0, 1]
        assert abs(neighbours) < 3 / math.sqrt(count)
    port = bench.column(SensorTank, "port_level_m") + bench.true(2)[::2]
    assert abs(np.corrcoef(port, samples[0.02])[0, 1]) < 3 / math.sqrt(len(port))


def test_same_seed_same_frames_other_seed_others() -> None:
    runs = []
    for seed in (3, 3, 4):
        bench = SensorBench(SensorErrors(), seed)
        bench.run(500)
        runs.append(bench.frames)
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


def test_messages_keep_the_cycles_of_the_catalogue() -> None:
    bench = SensorBench(SensorErrors())
    bench.run(1000, start_ns=777)
    for message, sender in (
        (SensorMotion, CATALOGUE.transmitter(SensorMotion)),
        (SensorTank, CATALOGUE.transmitter(SensorTank)),
        (SensorPump, CATALOGUE.transmitter(SensorPump)),
        (Heartbeat, CATALOGUE.transmitter(Heartbeat, Address.SENSORS)),
    ):
        assert set(np.diff(bench.times_ns[message])) == {sender.cycle_ns}
    assert all(beat.configuration_version == 5 for beat in bench.heard[Heartbeat])
    assert all(motion.quality is Quality.GOOD for motion in bench.heard[SensorMotion])


def test_high_level_switches_close_on_the_true_level_of_their_own_side() -> None:
    limit_m = 0.5
    bench = SensorBench(SensorErrors(0.0, 0.0, 0.0, 0.3, 0.0, limit_m))
    bench.run(2500)
    level_m = bench.true(2)[::2]
    assert level_m.max() > limit_m
    assert level_m.min() < -limit_m
    closed = {
        side: bench.column(SensorTank, f"{side}_high") == Switch.ON
        for side in ("port", "starboard")
    }
    np.testing.assert_array_equal(closed["starboard"], level_m > limit_m)
    np.testing.assert_array_equal(closed["port"], level_m < -limit_m)


@pytest.mark.parametrize(
    ("errors", "message"),
    [
        ({"roll_noise_rad": -1e-4}, "roll_noise_rad must be zero or more"),
        ({"motion_delay_ms": -20.0}, "motion_delay_ms must be 0 to 1000"),
        ({"motion_delay_ms": 25.0}, "motion_delay_ms must be a multiple of 10, got 25"),
        ({"roll_bias_rad": 1.0}, "roll_bias_rad must be -0.2 to 0.2"),
        ({"level_noise_m": math.nan}, "level_noise_m must be zero or more"),
    ],
)
def test_impossible_errors_are_refused(errors: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SensorErrors(**errors)
