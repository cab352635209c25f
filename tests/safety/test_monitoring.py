"""All monitors behind the controller node, fed by hand."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from controller_bench import CATALOGUE, VERSION
from controller_bench import VESSEL as SHIPPED
from monitors.moving_ship import FINDINGS, MovingShip
from values import changed

from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.canbus import (
    Address,
    DriveState,
    Frame,
    Quality,
    SensorMotion,
    SensorTank,
    Switch,
)
from utank_hil.configuration import Vessel, load_config
from utank_hil.control import DesignPlant
from utank_hil.dynamics.ship import RollShip
from utank_hil.nodes.inbox import Inbox
from utank_hil.retuning import ModelSummary, ShipFigures
from utank_hil.safety.monitoring import ROUND_TICKS, Monitors
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.thresholds import SensorFigures
from utank_hil.safety.situation import OwnState

VESSEL = SHIPPED.model_copy(update={"ship": replace(SHIPPED.ship, sway_of_slope=0.0)})

OF_MOTION = ("roll_rad", "roll_rate_rad_s", "heard_ns")


class Table:
    """Monitors and inbox without a node; `values` stand in for what was received."""

    def __init__(self, start_ns=0):
        plant = DesignPlant(VESSEL.ship, VESSEL.tank)
        self.monitors = Monitors(plant, 0.35, SensorFigures(), 250_000)
        self.inbox = Inbox(CATALOGUE, VERSION, thresholds=self.monitors.thresholds)
        self.values: dict[str, Any] = {}
        self.now_ns = start_ns
        self._motion = CATALOGUE.transmitter(SensorMotion)
        self._tank = CATALOGUE.transmitter(SensorTank)

    def measured(self, motion_age_ms=0.0, **changes):
        """What is measured, everything just now."""
        values = {"tank_age_ms": 0.0, "pump_age_ms": 0.0, **self.values, **changes}
        motion = {name: values.pop(name) for name in OF_MOTION if name in values}
        seen = self.inbox.snapshot(self.now_ns)
        sample = changed(seen.motions[0], age_ms=motion_age_ms, **motion)
        seen = changed(seen, motions=(sample,), **values)
        return changed(seen, level_m=(seen.starboard_level_m - seen.port_level_m) / 2)

    @property
    def roll_rad(self):
        return self.measured().motions[0].roll_rad

    def tick(self, seconds=TICK_S, command_pa=0.0, **changes):
        found = 0
        for _ in range(round(seconds / TICK_S)):
            self.now_ns += TICK_NS
            measured = self.measured(**changes)
            found = self.monitors.update(measured, OwnState(command_pa=command_pa))
        return found

    def say_roll(self, roll_rad, rate_rad_s=0.0):
        frame = self._motion.frame(SensorMotion(roll_rad, rate_rad_s, Quality.GOOD))
        self.inbox.receive(frame, self.now_ns)

    def say_levels(self, port_m, starboard_m):
        levels = SensorTank(port_m, starboard_m, Switch.OFF, Switch.OFF, Quality.GOOD)
        self.inbox.receive(self._tank.frame(levels), self.now_ns)


@pytest.mark.parametrize("start_ns", [0, 2 * 10**9, 10**13])
@pytest.mark.parametrize("before", [0, 1, 500])
def test_neither_the_clock_before_the_start_nor_frames_of_then_are_judged(start_ns, before):
    table = Table(start_ns)
    table.monitors.watch(table.inbox.watched, ())
    for _ in range(before):
        table.say_roll(0.0, 0.01)
    for k in range(50):
        assert not table.tick()
        table.say_roll(0.0)
        if k % 2:
            table.say_levels(0.0, 0.0)


def test_spike_of_the_roll_never_reaches_the_law():
    table = Table()
    for roll_rad in (0.01, 0.51, 0.011):
        table.say_roll(roll_rad)
        table.tick()
        assert table.roll_rad == pytest.approx(0.01, abs=2e-3)


def test_spike_of_a_level_never_reaches_the_law_but_its_switch_does():
    table = Table()
    table.say_levels(0.0, 0.0)
    table.tick()
    levels = SensorTank(3.0, 0.0, Switch.ON, Switch.OFF, Quality.GOOD)
    table.inbox.receive(table._tank.frame(levels), table.now_ns)
    assert table.measured().port_level_m == 0.0
    assert table.measured().high_level


def noisy_table(times):
    """Noise of the motion sensor over its figure; all that was found, and samples discarded."""
    table, random, found = Table(), np.random.default_rng(1), 0
    for k in range(1500):
        noise = times if k > 500 else 1.0
        roll_rad, rate_rad_s = random.standard_normal(2) * (2e-4, 5e-4) * noise
        table.say_roll(roll_rad, rate_rad_s)
        found |= table.tick()
    return table, found, table.inbox.discarded


def test_samples_that_noise_has_discarded_are_no_spikes():
    _, found, discarded = noisy_table(12.0)
    assert discarded > 10  # without the noise these would be too many
    assert found & Finding.NOISE
    assert not found & Finding.SPIKES
    assert not noisy_table(1.0)[1] & (Finding.NOISE | Finding.SPIKES)


def test_five_spikes_in_a_second_are_found():
    table = Table()
    table.say_roll(0.0)
    for _ in range(5):
        table.tick(0.15)
        table.say_roll(0.5)
        table.tick()
        table.say_roll(0.0)
    assert table.tick(0.1) & Finding.SPIKES


@pytest.mark.parametrize("start_ns", [0, 10**13])
def test_a_first_sample_that_waited_in_the_queue_is_no_drift(start_ns):
    table = Table(start_ns)
    roll_rad, found = 0.04, 0
    for tick in range(100):
        if tick == 3:  # what waited is read by then
            roll_rad -= 0.0059
        table.say_roll(roll_rad)
        found |= table.tick()
    assert table.roll_rad == pytest.approx(0.0341, abs=1e-4)
    assert found == 0


def test_gap_of_the_motion_sensor_is_no_drift():
    table = Table()
    table.say_roll(0.0)
    table.tick(1.0)
    table.tick(5.0, motion_age_ms=1000.0)
    table.say_roll(0.2)
    assert not table.tick(1.0) & ~Finding.SPIKES


def moved(table, ship, seconds, **seen):
    """What is found of a ship in motion, her inbox filled by hand."""
    found = 0
    for _ in range(round(seconds / TICK_S)):
        time_s = table.now_ns * 1e-9
        roll_rad, pressure_pa = ship.roll_rad(time_s), ship.pressure_pa(time_s)
        rate_rad_s, level_m = ship.rate_rad_s(time_s), ship.level_m(time_s)
        table.values |= {
            "roll_rad": roll_rad, "roll_rate_rad_s": rate_rad_s, "heard_ns": table.now_ns,
            "pressure_pa": pressure_pa, "starboard_level_m": level_m, "port_level_m": -level_m,
            "drive_state": DriveState.OPERATION_ENABLED,
        }  # fmt: skip
        stale = {name: age(time_s) for name, age in seen.items() if callable(age)}
        found |= table.tick(command_pa=pressure_pa, **stale)
    return {bit for bit in FINDINGS if bit & found}


ROLLING = MovingShip(math.radians(2.0), 5e3, noise=False)
T = 10.7


def gap(length_s, every_s=4.0):
    """Age in ms of a sensor that is silent for so long each time."""
    return lambda time_s: max(1000 * (length_s - (-time_s) % every_s), 0.0)


class Reversed(MovingShip):
    """Whose motion sensor has both signs, or that of the rate, wrong."""

    def __init__(self, roll, rate):
        super().__init__(math.radians(2.0), 5e3, noise=False)
        self._signs = roll, rate

    def roll_rad(self, t):
        return self._signs[0] * super().roll_rad(t)

    def rate_rad_s(self, t):
        return self._signs[1] * super().rate_rad_s(t)


@pytest.mark.evidence("signs0-16")
@pytest.mark.parametrize(
    ("signs", "found"), [((-1, -1), Finding.WATER_SIGN), ((1, -1), Finding.DRIFT_LASTS)]
)
def test_water_that_was_seen_to_disobey_has_to_obey_anew(signs, found):
    table = Table()
    moved(table, ROLLING, 30.0)
    assert table.monitors.confirmed
    assert found in moved(table, Reversed(*signs), 60.0)
    assert not table.monitors.confirmed
    moved(table, MovingShip(0.0, 0.0, noise=False), 300.0)
    assert not table.monitors.confirmed
    moved(table, ROLLING, 60.0)
    assert table.monitors.confirmed


class Fading(MovingShip):
    """Comes to rest slowly."""

    def __init__(self, since_s):
        super().__init__(math.radians(2.0), 5e3, noise=False)
        self._since_s = since_s

    def _at(self, phasor, time_s, noise):
        return super()._at(phasor, time_s, noise) * math.exp((self._since_s - time_s) / 40.0)


@pytest.mark.evidence
def test_the_water_has_to_obey_before_it_counts_as_watched():
    table = Table()
    moved(table, ROLLING, 5.0)
    assert not table.monitors.confirmed  # the filters have not settled
    moved(table, ROLLING, 5.0)
    assert table.monitors.confirmed
    still = Table()
    moved(still, MovingShip(0.0, 0.0, noise=False), 100.0)
    assert not still.monitors.confirmed
    moved(still, ROLLING, 50.0)  # so sudden a motion looks late at first
    assert still.monitors.confirmed
    moved(still, Fading(still.now_ns * 1e-9), 300.0)
    assert still.monitors.confirmed  # water at rest is watched, too


@pytest.mark.evidence(
    "0.15-motion_age_ms",
    "0.15-tank_age_ms",
    "0.15-pump_age_ms",
    "0.45-motion_age_ms",
    "0.45-tank_age_ms",
    "0.45-pump_age_ms",
)
@pytest.mark.parametrize("age", ["motion_age_ms", "tank_age_ms", "pump_age_ms"])
@pytest.mark.parametrize("length_s", [0.15, 0.3, 0.45])
def test_short_gaps_keep_nothing_from_being_judged(age, length_s):
    table = Table()
    assert not moved(table, ROLLING, 60.0, **{age: gap(length_s)})
    assert table.monitors.confirmed
    reversed_motion = MovingShip(math.radians(2.0), 5e3, noise=False)
    reversed_motion.level = -reversed_motion.level
    assert Finding.WATER_SIGN in moved(table, reversed_motion, T, **{age: gap(length_s)})


@pytest.mark.parametrize("age", ["motion_age_ms", "tank_age_ms", "pump_age_ms"])
def test_long_gaps_that_keep_the_water_from_being_judged_are_found(age):
    table = Table()
    moved(table, ROLLING, 12.0)
    assert table.monitors.confirmed
    longer = {age: gap(0.8)}
    # of each four seconds measurements come for three and a bit
    assert moved(table, ROLLING, 0.8 * T, **longer) <= {Finding.DRIFT}
    assert table.monitors.confirmed
    assert Finding.UNWATCHED in moved(table, ROLLING, T, **longer)
    assert not table.monitors.confirmed
    assert Finding.UNWATCHED_LONG not in moved(table, ROLLING, T, **longer)
    assert Finding.UNWATCHED_LONG in moved(table, ROLLING, 1.5 * T, **longer)
    moved(table, ROLLING, 6.0)
    assert Finding.UNWATCHED not in moved(table, ROLLING, 5.0)
    assert table.monitors.confirmed


@pytest.mark.parametrize("every_s", [0.3, 0.9])
def test_measurements_that_are_never_fresh_at_once_are_found_as_gaps(every_s):
    table = Table()
    moved(table, ROLLING, 12.0)
    assert table.monitors.confirmed
    turns = {
        "tank_age_ms": lambda time_s: 1000 * (time_s % every_s),
        "pump_age_ms": lambda time_s: 1000 * ((time_s + every_s / 2) % every_s),
    }
    assert not moved(table, ROLLING, 0.9 * T, **turns)
    assert table.monitors.confirmed
    assert Finding.UNWATCHED in moved(table, ROLLING, 0.3 * T, **turns)
    assert not table.monitors.confirmed
    assert Finding.UNWATCHED_LONG not in moved(table, ROLLING, 1.6 * T, **turns)
    assert Finding.UNWATCHED_LONG in moved(table, ROLLING, 0.4 * T, **turns)


def test_a_sensor_that_is_silent_for_good_is_not_a_gap():
    table = Table()
    moved(table, ROLLING, 12.0)
    found = moved(table, ROLLING, 5 * T, tank_age_ms=lambda time_s: 1000 * (time_s - 12.0))
    assert not found & {Finding.UNWATCHED, Finding.UNWATCHED_LONG}


@pytest.mark.parametrize("silent_s", [5.0, 60.0])
@pytest.mark.parametrize("before_s", [0.02, 12.0])
def test_sensors_that_come_or_come_back_after_a_silence_were_no_gap(before_s, silent_s):
    table = Table()
    moved(table, ROLLING, before_s)
    known = table.monitors.confirmed
    moved(table, ROLLING, silent_s, tank_age_ms=lambda time_s: 1000 * (time_s - before_s))
    found = moved(table, ROLLING, 1.0)
    assert not found & {Finding.UNWATCHED, Finding.UNWATCHED_LONG}
    assert table.monitors.confirmed is (known and silent_s < T)
    found = moved(table, ROLLING, 12.0)
    assert not found & {Finding.UNWATCHED, Finding.UNWATCHED_LONG}
    assert table.monitors.confirmed


def test_the_equation_of_a_small_model_runs_at_its_pace():
    tank = replace(VESSEL.tank, width_m=0.57, height_m=0.163, lz_m=0.061)
    assert tank.natural_frequency_rad_s > math.pi
    monitors = Monitors(DesignPlant(VESSEL.ship, tank), 0.35, SensorFigures(), 250_000)
    table, found = Table(), 0
    for tick in range(1000):
        table.now_ns = tick * TICK_NS
        found |= monitors.update(table.measured(), OwnState())
    assert monitors.equation.settled
    assert found == 0


@pytest.mark.parametrize("late_ticks", [1, 2, 4])
def test_late_ticks_keep_nothing_from_being_judged(late_ticks):
    table = Table()
    for _ in range(8):
        assert not moved(table, ROLLING, 2.0)
        table.now_ns += late_ticks * TICK_NS
    assert table.monitors.confirmed


@pytest.mark.parametrize("phase", range(5))
@pytest.mark.parametrize("lost", [1, 3])
def test_samples_that_are_lost_while_she_rolls_fast_are_no_drift(lost, phase):
    """Rate and roll are those of the last sample: the roll has not moved since, nor turned."""
    table = Table()
    found = 0
    for k in range(300):
        if not 200 + phase <= k < 200 + phase + lost:
            roll_rad = 0.1 * TICK_S * k
            table.values = {
                "roll_rad": roll_rad, "roll_rate_rad_s": 0.1, "heard_ns": table.now_ns,
            }  # fmt: skip
        found |= table.tick()
    assert not found & (Finding.DRIFT | Finding.NOISE)


def test_everything_is_looked_at_in_a_round():
    """Something wrong for each group is found within one round of ticks or the next."""
    table = Table()
    table.say_levels(0.5, 0.5)
    table.say_roll(0.0)
    table.tick(4 * ROUND_TICKS * TICK_S)
    table.values = {"roll_rad": 0.1, "foreign": 1000}
    found = table.tick(2 * ROUND_TICKS * TICK_S)
    for finding in (Finding.DRIFT, Finding.VOLUME, Finding.FLOOD):
        assert found & finding


def test_the_levels_are_looked_at_every_50_ms():
    """Seven looks in the memory of their noise were too few: some noise was found after 2 s."""
    table, level_m = Table(), 0.05
    table.say_levels(0.0, 0.0)
    table.tick(ROUND_TICKS * TICK_S)
    for _ in range(10):  # a sum that one look in two sees
        table.say_levels(level_m, level_m)
        table.tick(ROUND_TICKS / 2 * TICK_S)
        sum_m = table.monitors.volume.sum_m
        table.say_levels(0.0, 0.0)
        table.tick(ROUND_TICKS / 2 * TICK_S)
        assert table.monitors.volume.sum_m == pytest.approx(sum_m * (1 - 0.05 / 2.0))


def test_frames_of_no_node_are_counted_and_those_of_the_catalogue_are_not():
    table = Table()
    foreign = min(set(range(100)) - CATALOGUE.can_ids)
    undeclared = CATALOGUE.ids_sent_by(Address.PREVIEW)
    for can_id in (*CATALOGUE.can_ids - undeclared, foreign):
        table.inbox.receive(Frame(can_id, bytes(8)), 0)
    assert table.inbox.foreign == 1
    for can_id in undeclared:
        table.inbox.receive(Frame(can_id, bytes(8)), 0)
    assert table.inbox.foreign == 1 + len(undeclared) == 4


def test_twin_of_a_pump_at_rest_rolls_as_the_ship_does():
    table = Table()
    for k in range(6000):
        table.values["roll_rad"] = 0.05 * np.sin(0.6 * TICK_S * k)
        table.tick()
    twin = table.monitors.twin
    assert twin.rms_rad == pytest.approx(twin.ship_rms_rad, rel=1e-9)
    assert table.monitors.twin_message().twin_rms_rad == twin.rms_rad


@pytest.mark.parametrize(("share", "taken"), [(0.7, True), (0.6, False)])
def test_a_ship_that_her_tank_would_capsize_leaves_the_configured_twin(share, taken):
    """Patti-B's free surface takes 0.64 of her stiffness."""
    patti = load_config(Path("configs/ships/patti_b.yaml"), Vessel)
    plant = DesignPlant(patti.ship, patti.tank)
    monitors = Monitors(plant, 0.35, SensorFigures(), 250_000)
    given: list[RollShip] = []
    monitors.twin.take = lambda ship, tank: given.append(ship)  # type: ignore[method-assign]
    ship = patti.ship.with_figures(
        patti.ship.inertia_kg_m2, share * patti.ship.stiffness_nm_rad, patti.ship.damping_nms_rad
    )
    monitors.follow(ShipFigures.of(ship))
    assert given == [ship if taken else patti.ship]


@pytest.mark.parametrize("command_pa", [0.0, 5e3])
def test_twin_of_a_pump_whose_pressure_sensor_is_silent_takes_the_command(command_pa):
    """The last pressure measured stays in the inbox."""
    heard, silent = Table(), Table()
    for k in range(3000):
        for table, last_pa, age_ms in ((heard, command_pa, 0.0), (silent, -10e3, 101.0)):
            table.values["roll_rad"] = 0.05 * np.sin(0.6 * TICK_S * k)
            table.values["pressure_pa"] = last_pa
            table.tick(pump_age_ms=age_ms, command_pa=command_pa)
    assert silent.monitors.twin.roll_rad == heard.monitors.twin.roll_rad
    assert silent.monitors.twin.rms_rad == heard.monitors.twin.rms_rad


def test_a_roll_that_is_not_measured_any_more_is_not_compared():
    """What was compared before is kept: gaps now and then hide no law that loses."""
    table = Table()
    twin = table.monitors.twin
    table.values["roll_rad"] = 0.05
    table.tick(120.0)
    before = twin.ship_rms_rad, twin.share
    assert math.isfinite(twin.share)
    table.values["roll_rad"] = -0.05
    table.tick(5.0, motion_age_ms=101.0)
    assert (twin.ship_rms_rad, twin.share) == before
    table.tick(0.05, motion_age_ms=100.0)
    assert twin.ship_rms_rad > before[0]
    assert math.isfinite(twin.share)


def found_of(**changes):
    ship, tank = VESSEL.ship, VESSEL.tank
    found = ModelSummary(
        roll_period_s=10.0,
        period_deviation=0.01,
        inertia_kg_m2=1.2 * ship.inertia_kg_m2,
        stiffness_nm_rad=1.7 * ship.stiffness_nm_rad,
        damping_nms_rad=2 * ship.damping_nms_rad,
        tank_damping_ratio=1.5 * tank.damping_ratio,
        held_out_fit=0.99,
        peak_sensitivity=1.2,
        roll_below_passive=0.3,
    )
    return replace(found, **changes)


def test_twin_is_the_ship_that_the_law_in_charge_was_designed_for():
    table, taken = Table(), []
    twin = table.monitors.twin
    twin.take = lambda ship, tank: taken.append((ship, tank))  # type: ignore[method-assign]
    found = found_of()
    table.monitors.follow(None)
    assert not taken
    for _ in range(3):
        table.monitors.follow(found)
    ((ship, tank),) = taken
    assert (ship.inertia_kg_m2, ship.stiffness_nm_rad, ship.damping_nms_rad) == (
        found.inertia_kg_m2, found.stiffness_nm_rad, found.damping_nms_rad,
    )  # fmt: skip
    assert tank == replace(VESSEL.tank, damping_ratio=found.tank_damping_ratio)
    table.monitors.follow(None)  # rolled back
    assert taken[1:] == [(VESSEL.ship, VESSEL.tank)]


@pytest.mark.parametrize(
    "nonsense",
    [
        {"inertia_kg_m2": 0.0},
        {"inertia_kg_m2": 11 * VESSEL.ship.inertia_kg_m2},
        {"stiffness_nm_rad": -1e8},
        {"stiffness_nm_rad": 0.09 * VESSEL.ship.stiffness_nm_rad},
        {"damping_nms_rad": -1.0},
        {"damping_nms_rad": 1e30},
        {"tank_damping_ratio": -0.1},
        {"tank_damping_ratio": 1.1},
        {"tank_damping_ratio": float("nan")},
    ],
)
def test_a_ship_that_can_not_be_hers_leaves_the_configured_twin(nonsense):
    table, taken = Table(), []
    table.monitors.twin.take = lambda *pair: taken.append(pair)  # type: ignore[method-assign]
    table.monitors.follow(found_of(**nonsense))
    assert taken == [(VESSEL.ship, VESSEL.tank)]
