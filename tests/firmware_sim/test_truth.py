import numpy as np
import pytest
from drive_bench import calm_plant

from firmware_sim.truth import TRUTH, MemoryLog, TruthRecorder
from utank_hil.canbus import Frame

PERIOD_NS = 50_000_000


def test_rows_are_the_plants_state_at_the_instants_of_the_grid() -> None:
    plant, twin = calm_plant(), calm_plant()
    log = MemoryLog(len(TRUTH), 40)
    recorder = TruthRecorder(plant, log, PERIOD_NS)
    start_ns = 123_456_789
    for each in (plant, twin):
        each.advance(start_ns)
        each.drive_pump(30e3, enabled=True)
    for index in range(40):
        now_ns = start_ns + index * PERIOD_NS
        recorder.receive(Frame(0x08FF1080, bytes(8)), now_ns)
        assert list(recorder.tick(now_ns)) == []
        twin.advance(now_ns)
        row = dict(zip(TRUTH, log.rows[index], strict=True))
        assert row["time_s"] == pytest.approx(index * 0.05)
        assert row["true_roll_rad"] == twin.roll_rad
        assert row["true_level_m"] == twin.level_m
        assert row["true_pressure_pa"] == twin.pressure_pa
        assert row["true_shaft_power_w"] == twin.pump_power_w
        assert row["wave_moment_nm"] == twin.wave_moment_nm == 0.0
    assert recorder.start_ns == start_ns
    assert np.abs(log.rows[-1, TRUTH.index("true_level_m")]) > 0.01
