import numpy as np
import pytest
from drive_bench import calm_plant

from firmware_sim.run import ControllerRun, ShipRun, join
from firmware_sim.truth import TRUTH, TruthRecorder
from utank_hil.canbus import Frame
from utank_hil.runtime.signals import SIGNALS
from utank_hil.telemetry.table import Table

PERIOD_NS = 50_000_000


def test_rows_are_the_plants_state_at_the_instants_of_the_grid() -> None:
    plant, twin = calm_plant(), calm_plant()
    table = Table(len(TRUTH), 40)
    recorder = TruthRecorder(plant, table, PERIOD_NS)
    start_ns = 123_456_789
    for each in (plant, twin):
        each.advance(start_ns)
        each.drive_pump(30e3, enabled=True)
    for index in range(40):
        now_ns = start_ns + index * PERIOD_NS
        recorder.receive(Frame(0x08FF1080, bytes(8)), now_ns)
        assert list(recorder.tick(now_ns)) == []
        twin.advance(now_ns)
        row = dict(zip(TRUTH, table.rows[index], strict=True))
        assert row["time_s"] == pytest.approx(index * 0.05)
        assert row["true_roll_rad"] == twin.roll_rad
        assert row["true_level_m"] == twin.level_m
        assert row["true_pressure_pa"] == twin.pressure_pa
        assert row["true_shaft_power_w"] == twin.pump_power_w
        assert row["wave_moment_nm"] == twin.wave_moment_nm == 0.0
    assert recorder.start_ns == start_ns
    assert np.abs(table.rows[-1, TRUTH.index("true_level_m")]) > 0.01


def test_real_time_rows_are_joined_by_time_though_either_side_leaves_some_out() -> None:
    """The roll is made to be the ship's time, so that a wrong partner shows."""
    ship_s = np.delete(np.arange(0.0, 60.0, 0.05), [100, 101, 102, 700])
    truth = np.zeros((len(ship_s), len(TRUTH)))
    truth[:, 0] = truth[:, TRUTH.index("true_roll_rad")] = ship_s
    told_s = np.delete(np.arange(0.0, 50.0, 0.05), [3, 200, 201]) + 0.01
    told = np.zeros((len(told_s), len(SIGNALS)))
    told[:, 0] = told_s
    shift_s = 1.234
    ship = ShipRun(truth, 5_000_000_000, 3, 7.0)
    controller = ControllerRun(told, 6_234_000_000, None, ())  # type: ignore[arg-type]
    run = join("test", ship, controller)
    error_s = run.column("true_roll_rad") - (run.column("time_s") + shift_s)
    assert len(run.rows) == len(told_s)
    assert np.abs(error_s).max() <= 0.1 + 1e-9  # beside what the ship left out
    assert np.quantile(np.abs(error_s), 0.99) <= 0.025 + 1e-9
    assert (run.refused_commands, run.energy_j) == (3, 7.0)


@pytest.mark.parametrize("shift_ns", [-80_000_000_000, 80_000_000_000])
def test_halves_of_a_run_that_never_met_have_no_rows(shift_ns: int) -> None:
    times = np.arange(0.0, 50.0, 0.05)
    truth, told = np.zeros((1000, len(TRUTH))), np.zeros((1000, len(SIGNALS)))
    truth[:, 0] = told[:, 0] = times
    controller = ControllerRun(told, 100_000_000_000 + shift_ns, None, ())  # type: ignore[arg-type]
    assert len(join("test", ShipRun(truth, 100_000_000_000, 0, 0.0), controller).rows) == 0
    nothing = ShipRun(np.empty((0, len(TRUTH))), -1, 0, 0.0)
    assert len(join("test", nothing, controller).rows) == 0
