"""``utank-hil identify`` from a recording to a configuration, as a user runs it."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from utank_hil.cli import app
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control import pump_model
from utank_hil.dynamics import RollShip
from utank_hil.dynamics.sampling import sample
from utank_hil.identification import random_pulses
from utank_hil.telemetry.recording import write_recording

pytestmark = pytest.mark.slow

CONFIG = Path("configs/controllers/adaptive_dpc.yaml")
COLUMNS = ("time_s", "roll_rad", "port_level_m", "starboard_level_m", "pressure_command_pa")


def _rows(period_s, duration_s=300.0):
    """20 Hz telemetry of a ship pushed by pulses in still water."""
    config = load_config(CONFIG, ControllerConfig)
    configured, tank = config.vessel.ship, config.vessel.tank
    stiffness = configured.inertia_kg_m2 * (2 * np.pi / period_s) ** 2
    ship = RollShip(configured.inertia_kg_m2, stiffness, configured.damping_nms_rad)
    plant = sample(pump_model(ship, tank, ("roll_rad", "level_m")), 0.2, 0.05, 0.1)
    pulses = random_pulses(duration_s, config.limits, 1, sample_time_s=0.2)
    state, y = np.zeros(len(plant.A)), np.zeros((len(pulses), 2))
    for k, pressure_pa in enumerate(pulses):
        y[k] = plant.C @ state + plant.D[:, 0] * pressure_pa
        state = plant.A @ state + plant.B[:, 0] * pressure_pa
    y += np.random.default_rng(1).standard_normal(y.shape) * [2e-4, 3.5e-3]
    time_s = 0.05 * np.arange(4 * len(pulses))
    seen = np.repeat(y, 4, axis=0)
    # the command of sample k left in the 0.2 s before it
    command = np.repeat(np.append(pulses[1:], 0.0), 4)
    return np.column_stack([time_s, seen[:, 0], -seen[:, 1], seen[:, 1], command])


def identify(log, folder, *more):
    arguments = ["identify", str(log), str(CONFIG), "--out", str(folder), "--order", "60", *more]
    result = CliRunner().invoke(app, arguments)
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result


@pytest.fixture(scope="module")
def accepted(tmp_path_factory):
    """Folder of a model that was accepted, `out` in it with the results, and what was printed."""
    folder = tmp_path_factory.mktemp("accepted")
    write_recording(folder / "log.rrd", COLUMNS, {"run": _rows(9.0)})
    return folder, identify(folder / "log.rrd", folder / "out")


def test_recording_becomes_a_model_a_picture_and_a_configuration(accepted):
    folder, result = accepted
    assert result.exit_code == 0, result.output
    assert (folder / "out" / "identification.png").stat().st_size > 10_000
    config = load_config(folder / "out" / "identified_controller.yaml", ControllerConfig)
    given = load_config(CONFIG, ControllerConfig)
    assert config.law == given.law
    assert config.vessel.version != given.vessel.version
    assert config.vessel.ship.natural_frequency_rad_s == pytest.approx(2 * np.pi / 9.0, rel=0.01)


@pytest.mark.usefixtures("read_here")
def test_refused_model_leaves_reasons_and_nothing_of_an_earlier_acceptance(accepted, tmp_path):
    shutil.copytree(accepted[0] / "out", tmp_path / "out")
    write_recording(tmp_path / "log.rrd", COLUMNS, {"run": _rows(4.0)})
    result = identify(tmp_path / "log.rrd", tmp_path / "out", "--json")
    assert result.exit_code == 1
    figures = json.loads(result.stdout)
    assert figures["accepted"] is False
    assert figures["reasons"]
    assert figures["roll_period_s"] > 0
    assert [path.name for path in (tmp_path / "out-2").iterdir()] == ["identification.png"]


@pytest.mark.evidence
def test_configuration_that_is_read_is_not_written_over(accepted):
    folder, _ = accepted
    given = folder / "out" / "identified_controller.yaml"
    content = given.read_text()
    arguments = ["identify", str(folder / "log.rrd"), str(given), "--out", str(folder / "out")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0
    assert "former results are kept: these are in" in " ".join(result.stderr.split())
    assert given.read_text() == content


def test_tables_hold_what_an_engineer_asks_for(accepted):
    _, result = accepted
    words = " ".join(result.stdout.split())
    for part in (
        "roll period, s", "± 95 %", "tank damping ratio",
        "delay against the configured one: roll_rad",
        "1: frequency, rad/s", "2: frequency, rad/s", "correlated",
        "predictions", "Waves:", "Accepted: peak sensitivity",
    ):  # fmt: skip
        assert part in words, part
    assert max(len(line) for line in result.stdout.splitlines()[:30]) <= 80


@pytest.mark.parametrize("value", ["nan", "inf"])
def test_time_that_is_no_number_is_refused_by_its_option(tmp_path, value):
    arguments = [str(tmp_path / "log.rrd"), str(CONFIG), "--from", value]
    result = CliRunner().invoke(app, ["identify", *arguments])
    assert result.exit_code == 2
    assert "--from must be a number of seconds" in result.stderr


def test_file_that_is_no_recording_is_said_to_be_none(tmp_path):
    (tmp_path / "log.rrd").write_bytes(b"not a recording")
    result = CliRunner().invoke(app, ["identify", str(tmp_path / "log.rrd"), str(CONFIG)])
    assert result.exit_code == 2


def test_a_record_with_a_law_in_charge_is_refused(tmp_path):
    """Its command would be predicted by the motion; the intervals would not hold."""
    rows = _rows(9.0)
    rate_rad_s = np.gradient(rows[:, 1], 0.2)
    rows[4:, 4] = 2e6 * rate_rad_s[:-4] + 0.05 * rows[4:, 4]
    write_recording(tmp_path / "log.rrd", COLUMNS, {"run": rows})
    result = identify(tmp_path / "log.rrd", tmp_path / "out")
    assert result.exit_code == 1
    assert "refused: the command follows the motion" in result.stdout
    assert "Record pulses of the pump alone" in " ".join(result.stdout.split())
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["identification.png"]
