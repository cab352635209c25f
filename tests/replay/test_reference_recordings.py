"""The controller of today answers the kept recordings as it did when they were accepted.

A difference is a change of behaviour. If it is meant, ``python -m tools.reference_recordings
--accept`` records anew and prints what was accepted; that text belongs into the commit's message.
"""

from dataclasses import replace
from functools import cache
from itertools import chain, repeat

import numpy as np
import pytest

from tools.reference_recordings.cases import (
    CASES,
    CONTROLLERS,
    DESIGN_BOUND,
    FAULTS,
    LOGS,
    compare,
    record,
)
from utank_hil.analysis.loop.margins import margins
from utank_hil.assembly import build_controller_node, build_law
from utank_hil.canbus import (
    ControllerStatus,
    Fault,
    Mode,
    RetuningState,
    SensorMotion,
    load_catalogue,
)
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.dynamics.linear import pump_model
from utank_hil.telemetry.frame_comparison import RecordedRetuner
from utank_hil.telemetry.frame_log import FrameLog, Kind
from utank_hil.telemetry.law_values import decoded, encoded, law_values
from utank_hil.telemetry.replay import entries_of, replay, replay_log
from utank_hil.telemetry.replay_head import law_differences, recorded_config, recorded_law

STATUS = load_catalogue().codec(ControllerStatus)
MOTION = load_catalogue().codec(SensorMotion)
ACCEPT = "if this is meant: python -m tools.reference_recordings --accept"
MOST_BYTES = 600_000


@cache
def statuses(name):
    """What the controller said of itself in a recording."""
    entries = entries_of(FrameLog(LOGS / f"{name}.frames").blocks())
    sent = (STATUS.decode(data) for number, data, kind, _ in entries
            if kind == Kind.SENT and number == STATUS.can_id)  # fmt: skip
    return tuple(status for status in sent if status is not None)


@pytest.mark.parametrize("name", [case.name for case in CASES])
def test_every_frame_is_answered_as_recorded(name):
    said = compare(LOGS / f"{name}.frames")
    assert not said, f"{said}; {ACCEPT}"


def test_the_recordings_are_those_of_the_cases_and_small():
    files = sorted(LOGS.glob("*.frames"))
    assert [file.stem for file in files] == sorted(case.name for case in CASES)
    assert len(files) >= 10
    assert sum(file.stat().st_size for file in files) < MOST_BYTES


def test_between_them_they_meet_every_mode_many_faults_and_a_whole_retuning():
    met = [status for case in CASES for status in statuses(case.name)]
    assert {status.mode for status in met} == set(Mode)
    assert {status.fault for status in met} >= {
        Fault.MOTION_SILENT, Fault.TANK_SILENT, Fault.MOTION_SIGN_FLIP, Fault.LEVEL_LIMIT,
        Fault.DRIVE_FAULT, Fault.OVERRUN, Fault.BUS_LOST, Fault.OPERATOR_SILENT,
    }  # fmt: skip
    assert any(status.degraded and status.mode is Mode.ACTIVE for status in met)
    assert {status.retuning for status in statuses("retuned-and-undone")} >= {
        RetuningState.IDENTIFY, RetuningState.DESIGN, RetuningState.TRIAL, RetuningState.RETUNED,
        RetuningState.UNDONE,
    }  # fmt: skip


def test_one_bit_of_one_gain_is_named():
    log = FrameLog(LOGS / "every-mode.frames")
    with recorded_config(log.head) as config:
        law = build_law(config)
        # by this machine's design: another's may differ in its last bits
        log.head["law"] = encoded(law_values(law.controller()))
        controller = law.controller()
        bits = law_values(controller)["gains"].view("u8")  # the controller's own memory
        bits[0, 100] ^= 1
        (found,) = law_differences(log.head, replace(law, controller=lambda: controller))
    assert found.name == "gains[0, 100]"
    assert found.deviation < 1e-15


def test_a_recorded_law_answers_for_itself_and_today_s_design_is_judged_beside():
    """As on a processor whose design is another one: by a thousandth here, which frames show."""
    log = FrameLog(LOGS / "every-mode.frames")
    with recorded_config(log.head) as config:
        recorded = decoded(log.head["law"])
        log.head["law"] = encoded(recorded | {"gains": recorded["gains"] * 1.001})
        result, why, law = replay_log(log, config, LOGS)
    assert result.different["PUMP_CMD"] > 10  # they were answered by the law that was recorded
    assert (why, law.why_not_recorded) == ([], "")
    (gains,) = (each for each in law.differences if each.name.startswith("gains"))
    assert gains.deviation == law.deviation == pytest.approx(1e-3, rel=2e-3)
    assert law.deviation > DESIGN_BOUND
    assert law.loops is not None
    before, now = (np.array(each) for each in law.loops)
    np.testing.assert_allclose(before, now, rtol=0.01)  # A thousandth of gain does as little.
    assert (abs(before - now) > 1e-5 * now).all()
    assert 0.4 < now[0] < 0.8
    with recorded_config(log.head) as config:
        linear = build_law(config).linear
        plant = config.design_plant
        model = pump_model(plant.ship, plant.tank, build_law(config).measured)
        own = margins(linear, model, plant.delay_s, plant.lag_s, with_delay_margin=False)
    expected = own.peak_sensitivity, own.gain_high, own.phase_margin_rad
    assert now[1:] == pytest.approx(expected, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["adaptive_dpc", "self_tuning"])
def test_a_law_that_may_be_exchanged_begins_as_recorded(name):
    config = load_config(CONTROLLERS / f"{name}.yaml", ControllerConfig)
    designed = build_law(config)
    values = law_values(designed.controller())
    recorded = {key: x * (1 + 1e-9) if x.dtype.kind == "f" else x for key, x in values.items()}
    law, why = recorded_law({"law": encoded(recorded)}, config, designed)
    node = build_controller_node(config, law, retuner=RecordedRetuner(), commissioned=True)
    runs = law_values(node.law.law.laws.active.controller)
    assert not why
    assert {key: x.tobytes() for key, x in runs.items()} == {
        key: np.asarray(x).tobytes() for key, x in recorded.items()
    }


def test_a_design_that_another_weight_changes_is_beyond_the_bound():
    path = LOGS / "planned.frames"
    with recorded_config(FrameLog(path).head) as config:
        design = config.law
        assert isinstance(design, ConstrainedDesign)
        heavier = replace(design, pressure_weight_rad2=1.001 * design.pressure_weight_rad2)
        other = build_law(config.model_copy(update={"law": heavier}))
    head = FrameLog(path).head
    assert max(each.deviation for each in law_differences(head, other)) > 10 * DESIGN_BOUND


def test_numbers_that_do_not_fit_this_version_s_law_leave_the_one_designed_here():
    log = FrameLog(LOGS / "every-mode.frames")
    with recorded_config(log.head) as config:
        log.head["law"]["gains"] = encoded({"gains": np.zeros((1, 3))})["gains"]
        result, _, law = replay_log(log, config, LOGS)
    assert result.exact
    assert "gains is float64 of shape (1, 3) there" in law.why_not_recorded


def test_a_changed_limit_is_named_by_tick_signal_and_key():
    path = LOGS / "every-mode.frames"
    with recorded_config(FrameLog(path).head) as config:
        slower = replace(config.limits, rate_pa_s=config.limits.rate_pa_s / 2)
    said = compare(path, {"limits": slower})
    assert ", PUMP_CMD, pressure_pa: recorded " in said
    assert "configuration, limits.rate_pa_s: recorded " in said


def test_a_changed_reaction_is_named_by_the_mode_that_differs():
    path = LOGS / "motion-silent.frames"
    with recorded_config(FrameLog(path).head) as config:
        patient = replace(config.safety, motion_age_ms=1000.0)
    said = compare(path, {"safety": patient})
    assert "recorded" in said
    ages = f"recorded {config.safety.motion_age_ms!r}, replayed 1000.0"
    assert f"configuration, safety.motion_age_ms: {ages}" in said


def test_answers_of_the_retuner_are_part_of_the_recording():
    log = FrameLog(LOGS / "retuned-and-undone.frames")
    entries = (entry for entry in entries_of(log.blocks()) if entry.kind != Kind.ANSWER)
    with recorded_config(log.head) as config:
        result = replay(entries, config, build_law(config), retuner=True, estimating=True)
    assert result.first is not None
    assert result.different  # it waits for an answer, and goes on without a trial


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_faults_of_every_case_are_such_that_exist(case):
    assert len(FAULTS.validate_python(case.faults)) == len(case.faults)


def test_a_case_gives_the_same_bytes_every_time(tmp_path):
    (case,) = (case for case in CASES if case.name == "drive-fault")
    first, again = tmp_path / "first", tmp_path / "again"
    for folder in (first, again):
        folder.mkdir()
        record(case, folder)
    assert (first / "drive-fault.frames").read_bytes() == (
        again / "drive-fault.frames"
    ).read_bytes()


def test_one_bit_of_one_sensor_frame_is_found_at_its_tick_and_named(monkeypatch):
    log = FrameLog(LOGS / "every-mode.frames")
    entries = list(entries_of(log.blocks()))
    at = [n for n, each in enumerate(entries)
          if each.kind == Kind.RECEIVED and each.number == MOTION.can_id][400]  # fmt: skip
    tick = sum(each.kind == Kind.TICK for each in entries[:at])
    flipped = bytearray(entries[at].data)
    flipped[3] ^= 1
    with recorded_config(log.head) as config:
        law, _ = recorded_law(log.head, config, build_law(config))
        assert replay(entries, config, law).damaged == []
        entries[at] = entries[at]._replace(data=bytes(flipped))
        assert replay(entries, config, law).damaged == [(tick, "SENSOR_MOTION")]
        monkeypatch.setattr("utank_hil.telemetry.frame_comparison._NAMED", 3)
        wrong = [each._replace(data=bytes(8)) if each.number == MOTION.can_id else each
                 for each in entries[:at]]  # fmt: skip
        found = replay(wrong, config, law)
        assert (len(found.damaged), found.damaged_frames) == (3, 400)
        with pytest.raises(ValueError, match="sent more than 65536 frames"):
            replay(chain(entries[:at], repeat(entries[-1]._replace(kind=Kind.SENT))), config, law)
