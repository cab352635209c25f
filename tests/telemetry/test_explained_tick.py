"""The way of a tick as numbers: inputs, controller, law and frames."""

import json
from pathlib import Path

from typer.testing import CliRunner

from utank_hil.assembly import build_law
from utank_hil.canbus import SensorMotion, load_catalogue
from utank_hil.cli import app
from utank_hil.telemetry.explained_tick import ExplainedTick
from utank_hil.telemetry.frame_log import FrameLog, Kind
from utank_hil.telemetry.replay import entries_of, replay
from utank_hil.telemetry.replay_head import recorded_config

LOG = Path("tests/replay/every-mode.frames")
TICK = 700
NEXT_ANSWER = 710
"""The law answers every 0.1 s."""


def test_each_stage_is_explained_with_exact_numbers():
    said = CliRunner().invoke(app, ["replay", str(LOG), "--explain", str(TICK), "--json"])
    assert said.exit_code == 0
    numbers = json.loads(said.output)["explained"]
    assert {each["stage"] for each in numbers} == {"received", "controller", "law", "sent"}
    by_name = {each["name"]: each for each in numbers}
    roll_rad = float(by_name["SENSOR_MOTION.roll_rad"]["recorded"])
    assert float(by_name["roll_rad"]["replayed"]) == roll_rad
    command = by_name["PUMP_CMD.pressure_pa"]
    assert command["recorded"] == command["replayed"]
    # the command is the law's answer on the message's grid, a step of which is under 10 Pa
    answer_pa = float(by_name["pressure_command_pa"]["replayed"])
    assert abs(float(command["recorded"]) - answer_pa) < 10
    # of a memory of hundreds of samples only those that the tick wrote
    memory = [each for each in numbers if each["name"].startswith("flat")]
    assert 1 <= len(memory) < 10
    assert all("[" in each["name"] and "," not in each["replayed"] for each in memory)


def test_a_tick_that_is_not_there_is_refused():
    said = CliRunner().invoke(app, ["replay", str(LOG), "--explain", "1400"])
    assert said.exit_code == 2
    assert "its ticks are 0 to 1399" in said.output


def test_a_changed_sample_of_a_sensor_shows_in_law_and_command():
    log = FrameLog(LOG)
    codec = load_catalogue().codec(SensorMotion)
    explained = ExplainedTick(NEXT_ANSWER)
    changed, ticks = [], 0
    for entry in entries_of(log.blocks()):
        data = entry.data
        if entry.kind == Kind.RECEIVED and entry.number == codec.can_id and ticks == TICK:
            message = codec.decode(data)
            roll_rad = message.roll_rad + 1e-3
            data = codec.encode(message._replace(roll_rad=roll_rad), data[1] & 15)
        ticks += entry.kind == Kind.TICK
        changed.append(entry._replace(data=data))
    with recorded_config(log.head) as config:
        result = replay(changed, config, build_law(config), explained=explained)
    assert result.first.tick == NEXT_ANSWER
    numbers = {(each.stage, each.name): each for each in explained.numbers}
    command = numbers["sent", "PUMP_CMD.pressure_pa"]
    assert (command.recorded, command.replayed) == (result.first.recorded, result.first.replayed)
    assert command.recorded != command.replayed
