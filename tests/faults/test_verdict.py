"""What passes a row of the campaign, and what does not."""

from dataclasses import replace

import pytest
from judged_rows import CAMPAIGN, GOOD, ROWS, said, spoken, verdict


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"found": 10701.0}, "found after 10701 ms, 10700 allowed"),
        ({"found": None}, "was not found"),
        ({"zero": 601.0}, "pressure at zero after 601 ms, 600 allowed"),
        ({"code": "DRIFT", "zero": 10951.0}, "pressure at zero after 10951 ms, 10950 allowed"),
        ({"mode": "ACTIVE"}, "not latched: ended in ACTIVE"),
        ({"mode": "STANDBY"}, "not latched: ended in STANDBY"),
        ({"commanded": 601.0}, "pressure commanded until 601 ms, 600 allowed"),
        ({"beyond_share_pa": 1.0}, "more than it may while degraded"),
        ({"armed_again": True}, "armed again"),
        ({"code": "OVERRUN"}, "called OVERRUN"),
        ({"refused": 1}, "refused 1"),
        ({"wire": ""}, "did not reach the bus"),
        ({"was_active": False}, "not in charge before"),
        ({"variance": 1.2}, "rolls 1.10 times"),
        ({"error": "ValueError: x"}, "ValueError"),
    ],
)
def test_one_seed_of_two_fails_the_row(change, words):
    assert spoken("both-signs-flipped", GOOD, GOOD).passed
    result = spoken("both-signs-flipped", GOOD, replace(GOOD, seed=2, **change))
    assert not result.passed
    assert any(words in problem for problem in result.problems)


def test_in_charge_a_fault_may_roll_the_ship_as_the_sound_law_does_in_a_lull():
    """Where that is more than the passive ship."""
    calm = replace(GOOD, mode="ACTIVE", found=None, code="NONE", noted=10.0, variance=1.5)
    assert spoken("roll-spike", replace(calm, sound_variance=1.45)).passed
    for variance, words in ((1.4, "1.07 times the sound"), (0.5, "1.50 times the passive")):
        problems = spoken("roll-spike", replace(calm, sound_variance=variance)).problems
        assert [words in problem for problem in problems] == [True]
    assert not spoken("roll-spike", calm).passed  # of which no sound run is known


def test_commands_that_change_faster_than_the_limit_fail_a_ramp():
    limit_pa_s = CAMPAIGN.setups["pump"].config.limits.rate_pa_s
    ramp = replace(GOOD, row="motion-silent", found=50.0, zero=240.0, code="MOTION_SILENT")
    assert spoken("motion-silent", replace(ramp, steepest_pa_s=limit_pa_s)).passed
    fast = spoken("motion-silent", replace(ramp, steepest_pa_s=1.01 * limit_pa_s))
    assert [why.partition(" at ")[0] for why in fast.problems] == ["seed 1: commands changed"]


def test_each_reaction_asks_for_its_own():
    calm = replace(GOOD, mode="ACTIVE", found=None, code="NONE")
    assert spoken("roll-spike", replace(calm, noted=10.0)).passed
    assert not spoken("roll-spike", replace(calm, noted=10.0, halved=20.0)).passed
    assert not spoken("roll-spike", calm).passed
    assert spoken("roll-100-ms-late", calm).passed
    assert not spoken("roll-100-ms-late", GOOD).passed
    assert spoken("roll-drift-slow", replace(calm, halved=50.0, alarm=100.0)).passed
    assert spoken("level-noise", replace(calm, alarm=100.0)).passed
    assert not spoken("level-noise", replace(calm, halved=50.0, alarm=100.0)).passed
    lossy = replace(calm, alarm=900.0)
    assert spoken("gateway-loses-5-percent", lossy).passed
    assert not spoken("gateway-loses-5-percent", replace(lossy, alarm=5100.0)).passed
    assert not spoken("gateway-loses-5-percent", replace(lossy, alarm=None)).passed
    assert not spoken("gateway-loses-5-percent", replace(lossy, halved=20.0)).passed
    ramp = replace(GOOD, code="TANK_SILENT", found=990.0, zero=1500.0, halved=100.0)
    assert spoken("tank-silent", ramp).passed
    assert not spoken("tank-silent", replace(ramp, halved=130.0)).passed
    assert not spoken("tank-silent", replace(ramp, steepest_pa_s=300e3)).passed
    assert spoken("controller-killed", replace(GOOD, code="NONE", zero=60.0)).passed
    assert not spoken("controller-killed", replace(GOOD, code="NONE", zero=110.0)).passed
    refused = replace(calm, was_active=False, mode="STANDBY")
    assert spoken("held-arm-bit", refused).passed
    assert not spoken("held-arm-bit", replace(refused, was_active=True)).passed


@pytest.mark.parametrize(
    ("row", "change", "instead"),
    [
        ("roll-drift-slow",
         {"found": 310.0, "mode": "FAULT", "code": "DRIFT", "alarms": ("DRIFT",)},
         "latched DRIFT after 310 ms, alarms DRIFT"),
        ("level-noise", {"halved": 50.0, "noted": 20.0},
         "halved the pressure after 50 ms, passed over a frame after 20 ms"),
        ("both-signs-flipped", {"alarm": 90.0}, "gave an alarm of the row after 90 ms"),
        ("both-signs-flipped", {}, "nothing, and ended in ACTIVE"),
    ],
)  # fmt: skip
def test_what_happened_instead_of_what_was_not_found_is_said(row, change, instead):
    calm = replace(GOOD, mode="ACTIVE", found=None, code="NONE", alarms=())
    problems = verdict(row, replace(calm, **change)).problems
    assert f"seed 1: was not found; instead: {instead}" in problems


def test_a_fault_that_is_latched_has_a_name_of_the_row():
    other = replace(GOOD, code="OVERRUN", alarm=600.0)
    assert spoken("both-signs-flipped", other).problems == ["seed 1: called OVERRUN"]


def test_where_nothing_is_latched_an_alarm_has_the_row_s_name_in_time():
    halved = replace(GOOD, mode="ACTIVE", found=None, code="NONE", halved=50.0)
    assert spoken("roll-drift-slow", replace(halved, alarm=30100.0)).passed
    late = spoken("roll-drift-slow", replace(halved, alarm=30101.0))
    assert late.problems == ["seed 1: called NONE"]
    refused = replace(GOOD, mode="INIT", was_active=False, found=None, code="MOTION_SILENT")
    assert spoken("high-level-before-ready", replace(refused, alarm=9000.0)).passed
    assert not spoken("high-level-before-ready", refused).passed


@pytest.mark.parametrize(
    ("row", "change", "words"),
    [
        ("both-signs-flipped", {"status": "ACTIVE NONE"}, "CTRL_STATUS shows ACTIVE NONE"),
        ("both-signs-flipped", {"status": "FAULT NONE"}, "CTRL_STATUS shows FAULT NONE"),
        ("both-signs-flipped", {"status": ""}, "CTRL_STATUS shows nothing"),
        ("both-signs-flipped", {"alarms": ()}, "no alarm MOTION_SIGN_FLIP"),
        ("level-offset", {"alarms": ("VOLUME",)}, "no alarm SIGNAL_DELAYED"),
        ("level-offset", {"alarms": ("SIGNAL_DELAYED",)}, "no alarm VOLUME"),
        ("level-offset", {"flags": ("alarm",)}, "never said degraded"),
        ("saturated", {"flags": ("degraded",)}, "never said saturated"),
        ("saturated", {"alarms": ("DRIFT",)}, "no alarm with its name"),
        ("drive-warns", {"alarms": ()}, "no alarm with its name"),
    ],
)
def test_what_the_bus_was_not_told_fails_the_row(row, change, words):
    outcome = {
        "both-signs-flipped": GOOD,
        "level-offset": replace(GOOD, code="SIGNAL_DELAYED", found=31e3, halved=1e3,
                                zero=31.5e3),
        "saturated": replace(GOOD, mode="ACTIVE", found=None, code="NONE", alarm=10.1e3),
        "drive-warns": replace(GOOD, mode="ACTIVE", found=None, code="NONE", alarm=100.0),
    }[row]  # fmt: skip
    sound = said(row, outcome)
    sound = replace(sound, flags=(*sound.flags, *ROWS[row].expect.also))
    assert verdict(row, sound).passed
    wrong = verdict(row, replace(sound, **change))
    assert [words in why for why in wrong.problems] == [True]


@pytest.mark.parametrize(("halved_ms", "passed"), [(799.0, False), (800.0, True), (None, True)])
def test_what_was_halved_for_less_than_two_cycles_need_not_be_in_a_status(halved_ms, *, passed):
    latched = replace(GOOD, code="VOLUME", found=1000.0, zero=1200.0, halved=halved_ms)
    assert verdict("naval-level-offset", replace(said("naval-level-offset", latched), flags=())
                   ).passed is passed  # fmt: skip


def test_where_the_bus_is_full_nothing_is_asked_of_what_was_said():
    full = replace(GOOD, code="BUS_OVERLOAD", found=800.0, zero=820.0)
    assert verdict("flood-by-known-identifier", full).passed
    assert not verdict("bus-off", replace(full, code="BUS_LOST", found=0.0, zero=50.0)).passed


@pytest.mark.parametrize("mode", ["STANDBY", "PASSIVE", "ACTIVE"])
def test_a_reset_that_was_obeyed_while_the_cause_lasts_fails_the_row(mode):
    kept = replace(GOOD, row="reset-under-high-level", code="LEVEL_LIMIT", found=10, zero=30)
    assert spoken("reset-under-high-level", kept).passed
    assert not spoken("reset-under-high-level", replace(kept, mode=mode)).passed


def test_minutes_later_a_run_may_end_in_the_faults_that_the_row_names():
    noisy = replace(GOOD, found=None, halved=50.0, alarm=100.0, code="DRIFT")
    assert spoken("noise-10-fold", noisy).passed
    assert not spoken("noise-10-fold", replace(noisy, code="OVERRUN")).passed
    assert not spoken("noise-10-fold", replace(noisy, found=3000.0)).passed
    assert not spoken("level-noise", noisy).passed


def test_a_ramp_that_comes_before_the_stop_has_the_stops_time():
    ramp = replace(GOOD, code="DRIFT", found=100.0, zero=1200.0)
    assert spoken("both-signs-flipped", ramp).passed
    assert spoken("both-signs-flipped", ramp).zero_limit_ms == 10950.0
    assert spoken("both-signs-flipped", GOOD).zero_limit_ms == 600.0


def test_wrong_signs_may_be_found_by_the_still_water_if_the_alarm_names_them_too():
    still = replace(GOOD, code="STUCK_SIGNAL", found=3550.0, zero=4600.0)
    assert spoken("both-signs-from-start", still).passed
    silent = replace(said("both-signs-from-start", still), alarms=("STUCK_SIGNAL",))
    assert verdict("both-signs-from-start", silent).problems == [
        "seed 1: no alarm MOTION_SIGN_FLIP was sent",
    ]


def test_a_fault_that_refuses_arming_is_found():
    refused = replace(GOOD, found=None, zero=0.0, mode="STANDBY", was_active=False)
    assert spoken("both-signs-from-start", refused).passed
    assert not spoken("both-signs-from-start", replace(refused, code="NONE")).passed
    assert not spoken("both-signs-flipped", refused).passed


def test_the_worst_seed_counts_and_none_where_one_was_not_found():
    later = replace(GOOD, seed=2, found=700.0, zero=730.0)
    assert spoken("both-signs-flipped", GOOD, later).found_ms == 700.0
    missed = replace(GOOD, seed=2, found=None)
    assert spoken("both-signs-flipped", GOOD, missed).found_ms is None
