"""What passes a row of the campaign, and what does not."""

from dataclasses import replace

import pytest
from judged_rows import CAMPAIGN, GOOD, ROWS, said, spoken, verdict


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"found_ms": 1001.0}, "found after 1001 ms, 1000 allowed"),
        ({"found_ms": None}, "was not found"),
        ({"zero_ms": 601.0}, "pressure at zero after 601 ms, 600 allowed"),
        ({"code": "DRIFT", "zero_ms": 1251.0}, "pressure at zero after 1251 ms, 1250 allowed"),
        ({"mode": "ACTIVE"}, "not latched: ended in ACTIVE"),
        ({"mode": "STANDBY"}, "not latched: ended in STANDBY"),
        ({"commanded_ms": 601.0}, "pressure commanded until 601 ms, 600 allowed"),
        ({"beyond_share_pa": 1.0}, "more than it may while degraded"),
        ({"armed_again": True}, "armed again"),
        ({"code": "OVERRUN"}, "called OVERRUN"),
        ({"refused": 1}, "refused 1"),
        ({"wire": ""}, "did not reach the bus"),
        ({"was_active": False}, "not in charge before"),
        ({"roll_variance": 1.2}, "rolls 1.10 times"),
        ({"error": "ValueError: x"}, "ValueError"),
    ],
)
def test_one_seed_of_two_fails_the_row(change: dict[str, object], words: str) -> None:
    assert spoken("roll-sign-flipped", GOOD, GOOD).passed
    result = spoken("roll-sign-flipped", GOOD, replace(GOOD, seed=2, **change))  # type: ignore[arg-type]
    assert not result.passed
    assert any(words in problem for problem in result.problems)


def test_commands_that_change_faster_than_the_limit_fail_a_ramp() -> None:
    limit_pa_s = CAMPAIGN.setups["pump"].config.limits.rate_pa_s
    ramp = replace(GOOD, row="motion-silent", found_ms=50.0, zero_ms=240.0, code="MOTION_SILENT")
    assert spoken("motion-silent", replace(ramp, steepest_pa_s=limit_pa_s)).passed
    fast = spoken("motion-silent", replace(ramp, steepest_pa_s=1.01 * limit_pa_s))
    assert [why.partition(" at ")[0] for why in fast.problems] == ["seed 1: commands changed"]


def test_each_reaction_asks_for_its_own() -> None:
    calm = replace(GOOD, mode="ACTIVE", found_ms=None, code="NONE")
    assert spoken("roll-spike", replace(calm, noted_ms=10.0)).passed
    assert not spoken("roll-spike", replace(calm, noted_ms=10.0, halved_ms=20.0)).passed
    assert not spoken("roll-spike", calm).passed
    assert spoken("roll-100-ms-late", calm).passed
    assert not spoken("roll-100-ms-late", GOOD).passed
    assert spoken("noise-10-fold", replace(calm, halved_ms=50.0, alarm_ms=100.0)).passed
    lossy = replace(calm, alarm_ms=900.0)
    assert spoken("gateway-loses-5-percent", lossy).passed
    assert not spoken("gateway-loses-5-percent", replace(lossy, alarm_ms=5100.0)).passed
    assert not spoken("gateway-loses-5-percent", replace(lossy, alarm_ms=None)).passed
    assert not spoken("gateway-loses-5-percent", replace(lossy, halved_ms=20.0)).passed
    ramp = replace(GOOD, code="TANK_SILENT", found_ms=990.0, zero_ms=1500.0, halved_ms=100.0)
    assert spoken("tank-silent", ramp).passed
    assert not spoken("tank-silent", replace(ramp, halved_ms=130.0)).passed
    assert not spoken("tank-silent", replace(ramp, steepest_pa_s=300e3)).passed
    assert spoken("controller-killed", replace(GOOD, code="NONE", zero_ms=60.0)).passed
    assert not spoken("controller-killed", replace(GOOD, code="NONE", zero_ms=110.0)).passed
    refused = replace(calm, was_active=False, mode="STANDBY")
    assert spoken("held-arm-bit", refused).passed
    assert not spoken("held-arm-bit", replace(refused, was_active=True)).passed


def test_a_fault_that_is_latched_has_a_name_of_the_row() -> None:
    other = replace(GOOD, code="OVERRUN", alarm_ms=600.0)
    assert spoken("roll-sign-flipped", other).problems == ("seed 1: called OVERRUN",)


def test_where_nothing_is_latched_an_alarm_has_the_row_s_name_in_time() -> None:
    halved = replace(GOOD, mode="ACTIVE", found_ms=None, code="NONE", halved_ms=50.0)
    assert spoken("noise-10-fold", replace(halved, alarm_ms=2100.0)).passed
    late = spoken("noise-10-fold", replace(halved, alarm_ms=2101.0))
    assert late.problems == ("seed 1: called NONE",)
    refused = replace(GOOD, mode="INIT", was_active=False, found_ms=None, code="MOTION_SILENT")
    assert spoken("high-level-before-ready", replace(refused, alarm_ms=9000.0)).passed
    assert not spoken("high-level-before-ready", refused).passed


@pytest.mark.parametrize(
    ("row", "change", "words"),
    [
        ("roll-sign-flipped", {"shown": "ACTIVE NONE"}, "CTRL_STATUS shows ACTIVE NONE"),
        ("roll-sign-flipped", {"shown": "FAULT NONE"}, "CTRL_STATUS shows FAULT NONE"),
        ("roll-sign-flipped", {"shown": ""}, "CTRL_STATUS shows nothing"),
        ("roll-sign-flipped", {"told": ()}, "no alarm MOTION_SIGN_FLIP"),
        ("level-offset", {"told": ("VOLUME",)}, "no alarm SIGNAL_DELAYED"),
        ("level-offset", {"told": ("SIGNAL_DELAYED",)}, "no alarm VOLUME"),
        ("level-offset", {"flags": ("alarm",)}, "never said degraded"),
        ("saturated", {"flags": ("degraded",)}, "never said saturated"),
        ("saturated", {"told": ("DRIFT",)}, "no alarm with its name"),
        ("drive-warns", {"told": ()}, "no alarm with its name"),
    ],
)
def test_what_the_bus_was_not_told_fails_the_row(
    row: str, change: dict[str, object], words: str
) -> None:
    outcome = {
        "roll-sign-flipped": GOOD,
        "level-offset": replace(GOOD, code="SIGNAL_DELAYED", found_ms=31e3, halved_ms=1e3,
                                zero_ms=31.5e3),
        "saturated": replace(GOOD, mode="ACTIVE", found_ms=None, code="NONE", halved_ms=10.1e3,
                             alarm_ms=10.1e3),
        "drive-warns": replace(GOOD, mode="ACTIVE", found_ms=None, code="NONE", alarm_ms=100.0),
    }[row]  # fmt: skip
    sound = said(row, outcome)
    sound = replace(sound, flags=(*sound.flags, *ROWS[row].flags))
    assert verdict(row, sound).passed
    wrong = verdict(row, replace(sound, **change))  # type: ignore[arg-type]
    assert [words in why for why in wrong.problems] == [True]


@pytest.mark.parametrize(("halved_ms", "passed"), [(799.0, False), (800.0, True), (None, True)])
def test_what_was_halved_for_less_than_two_cycles_need_not_be_in_a_status(
    halved_ms: float | None, *, passed: bool
) -> None:
    latched = replace(GOOD, code="VOLUME", found_ms=1000.0, zero_ms=1200.0, halved_ms=halved_ms)
    assert verdict("naval-level-offset", replace(said("naval-level-offset", latched), flags=())
                   ).passed is passed  # fmt: skip


def test_where_the_bus_is_full_nothing_is_asked_of_what_was_said() -> None:
    full = replace(GOOD, code="BUS_OVERLOAD", found_ms=800.0, zero_ms=820.0)
    assert verdict("flood-by-known-identifier", full).passed
    assert not verdict("bus-off", replace(full, code="BUS_LOST", found_ms=0.0, zero_ms=50.0)).passed


@pytest.mark.parametrize("mode", ["STANDBY", "PASSIVE", "ACTIVE"])
def test_a_reset_that_was_obeyed_while_the_cause_lasts_fails_the_row(mode: str) -> None:
    kept = replace(GOOD, row="reset-under-high-level", code="LEVEL_LIMIT", found_ms=10, zero_ms=30)
    assert spoken("reset-under-high-level", kept).passed
    assert not spoken("reset-under-high-level", replace(kept, mode=mode)).passed


def test_minutes_later_a_run_may_end_in_the_faults_that_the_row_names() -> None:
    noisy = replace(GOOD, found_ms=None, halved_ms=50.0, alarm_ms=100.0, code="DRIFT")
    assert spoken("noise-10-fold", noisy).passed
    assert not spoken("noise-10-fold", replace(noisy, code="OVERRUN")).passed
    assert not spoken("noise-10-fold", replace(noisy, found_ms=3000.0)).passed
    assert not spoken("level-noise", noisy).passed


def test_a_ramp_that_comes_before_the_stop_has_the_stops_time() -> None:
    ramp = replace(GOOD, code="DRIFT", found_ms=100.0, zero_ms=1200.0)
    assert spoken("roll-sign-flipped", ramp).passed
    assert spoken("roll-sign-flipped", ramp).zero_limit_ms == 1250.0
    assert spoken("roll-sign-flipped", GOOD).zero_limit_ms == 600.0


def test_a_fault_that_refuses_arming_is_found() -> None:
    refused = replace(GOOD, found_ms=None, zero_ms=0.0, mode="STANDBY", was_active=False)
    assert spoken("both-signs-from-start", refused).passed
    assert not spoken("both-signs-from-start", replace(refused, code="NONE")).passed
    assert not spoken("both-signs-flipped", refused).passed


def test_the_worst_seed_counts_and_none_where_one_was_not_found() -> None:
    later = replace(GOOD, seed=2, found_ms=700.0, zero_ms=730.0)
    assert spoken("roll-sign-flipped", GOOD, later).found_ms == 700.0
    missed = replace(GOOD, seed=2, found_ms=None)
    assert spoken("roll-sign-flipped", GOOD, missed).as_json()["found_ms"] is None
