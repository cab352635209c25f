"""``utank-hil check``: whatever is wrong in a file is told with its place, and bench agrees."""

import copy
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner
from whole_configuration import whole
from wrong_values import WRONG

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from utank_hil.assembly import build_controller_node, build_law, retuner_work
from utank_hil.base.parameters import ParameterError
from utank_hil.cli import app
from utank_hil.commands.check import radius_words
from utank_hil.configuration import ConfigError, ControllerConfig, Vessel, load_config
from utank_hil.console import terminal
from utank_hil.retuning import SimulatedRetuner

CONFIGS = Path("configs").resolve()
WIDE = {"TERM": "dumb", "COLUMNS": "300", "NO_COLOR": "1"}


def invoke(*arguments: object, columns: int = 300):
    environment = {**WIDE, "COLUMNS": str(columns)}
    return CliRunner(env=environment).invoke(app, [str(argument) for argument in arguments])


def told(result) -> set[tuple[str, str, str]]:
    """File name, key and reason of every error; nothing else may have ended the command."""
    assert isinstance(result.exception, SystemExit), result.exception
    assert result.exit_code == 2
    assert result.stdout == ""
    lines = [line for line in result.stderr.splitlines() if line.startswith("error: ")]
    found = [re.fullmatch(r"error: (\S+?): (?:([\w.]+): )?(.*)", line) for line in lines]
    return {(Path(each[1]).name, each[2] or "", each[3]) for each in found if each}


def controller(folder: Path, shipped: str, **changes: object) -> Path:
    """A copy of a shipped controller with dotted keys (``__`` for the dot) changed or added."""
    content = yaml.safe_load((CONFIGS / "controllers" / f"{shipped}.yaml").read_text())
    content["vessel"] = str(CONFIGS / "ships" / "thesis_first.yaml")
    for key, value in changes.items():
        *parents, last = key.split("__")
        place = content
        for parent in parents:
            place = place.setdefault(parent, {})
        place[last] = value
    path = folder / "controller.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


def scenario(folder: Path, path: Path) -> Path:
    """A scenario with a controller."""
    content = {
        "name": "swell",
        "vessel": str(CONFIGS / "ships" / "thesis_first.yaml"),
        "sea": {"kind": "regular", "amplitude_m": 1.0, "period_s": 10.0},
        "controllers": {"one": str(path)},
        "operator": [{"time_s": 5.0, "action": "arm"}],
        "duration_s": 20.0,
        "settle_s": 5.0,
    }
    file = folder / "scenario.yaml"
    file.write_text(yaml.safe_dump(content), encoding="utf-8")
    return file


@pytest.mark.parametrize(("shipped", "changes", "expected"), WRONG, ids=lambda v: str(v)[:50])
def test_wrong_value_is_told_with_file_key_and_reason_by_check_bench_and_run(
    tmp_path: Path, shipped: str, changes: dict[str, object], expected: dict[str, str]
) -> None:
    path = controller(tmp_path, shipped, **changes)
    errors = told(invoke("check", path))
    reasons = {key: reason for file, key, reason in errors if file == path.name}
    assert set(reasons) == set(expected)
    for key, reason in expected.items():
        assert reason in reasons[key]
    if (shipped, changes, expected) in WRONG[:5]:  # all three read a file in the same way
        assert told(invoke("run", path, "--bus", "nowhere0")) == errors
        assert told(invoke("bench", scenario(tmp_path, path), "--out", tmp_path)) == errors


def test_every_wrong_value_of_a_scenario_s_sections_has_its_own_key(tmp_path: Path) -> None:
    path = scenario(tmp_path, controller(tmp_path, "pd"))
    content = yaml.safe_load(path.read_text())
    content["sea"]["effective_slope"] = {"coefficient": -1, "depth_m": -2.0, "beam_m": "wide"}
    content["sensors"] = {"roll_noise_rad": -1, "motion_delay_ms": 1010, "high_level_m": 0}
    content["drive"] = {"pressure_pa": 0, "longest_timeout_ms": 60e3, "bus_voltage_v": 1500}
    content["operator"] = [{"time_s": -1, "action": "arm"}, {"time_s": 5, "action": "amr"}]
    path.write_text(yaml.safe_dump(content))
    reasons = {key: reason for _, key, reason in told(invoke("check", path))}
    expected = {
        "sea.effective_slope.coefficient": "must be 0 to 2",
        "sea.effective_slope.depth_m": "must be zero or more",
        "sea.effective_slope.beam_m": "must be a number, got 'wide'",
        "sensors.roll_noise_rad": "must be zero or more",
        "sensors.motion_delay_ms": "must be 0 to 1000",
        "sensors.high_level_m": "must be positive",
        "drive.pressure_pa": "must be positive",
        "drive.longest_timeout_ms": "must be above 0 and at most 100",
        "drive.bus_voltage_v": "must be 4 to 1000",
        "operator.0.time_s": "must be zero or more",
        "operator.1.action": "amr",
    }
    assert set(reasons) == set(expected)
    for key, reason in expected.items():
        assert reason in reasons[key]


def test_every_wrong_number_of_a_ship_has_its_own_key(tmp_path: Path) -> None:
    content = whole(CONFIGS / "ships" / "thesis_first.yaml")
    content["ship"] = {"inertia_kg_m2": -1, "stiffness_nm_rad": 0, "damping_nms_rad": -3}
    content["pump"]["lag_s"] = "slow"
    path = tmp_path / "ship.yaml"
    path.write_text(yaml.safe_dump(content))
    keys = {key for _, key, _ in told(invoke("check", path))}
    assert keys == {
        "ship.inertia_kg_m2", "ship.stiffness_nm_rad", "ship.damping_nms_rad", "pump.lag_s",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("section", "key", "value", "reason"),
    [
        ("ship", "stiffness_nm_rad", 1e7, "takes all of the ship's stability"),
        ("tank", "reservoir_area_m2", 170.0, "more roll inertia in its water than"),
    ],
)
def test_ship_that_can_not_carry_her_tank_is_refused(
    tmp_path: Path, section: str, key: str, value: float, reason: str
) -> None:
    content = whole(CONFIGS / "ships" / "thesis_first.yaml")
    content[section][key] = value
    path = tmp_path / "ship.yaml"
    path.write_text(yaml.safe_dump(content))
    assert any(at == "tank" and reason in why for _, at, why in told(invoke("check", path)))


def test_ship_is_recognised_and_shown_in_numbers() -> None:
    path = CONFIGS / "ships" / "thesis_first.yaml"
    report = json.loads(invoke("check", path, "--json").stdout)
    assert report["kind"] == "ship"
    vessel = load_config(path, Vessel)
    assert report["roll_frequency_rad_s"] == pytest.approx(0.5)
    assert report["tank_frequency_rad_s"] == vessel.tank.natural_frequency_rad_s
    assert report["mass_ratio"] == pytest.approx(0.0366, rel=1e-2)  # docs/control.md
    # rho g At L^2 / 2, two reservoirs at half the width
    free_surface = 1000 * 9.80665 * 17.11 * 17.1**2 / 2
    assert report["stability_taken"] == pytest.approx(free_surface / 4.81875e8)
    slow, fast = (mode["frequency_rad_s"] for mode in report["modes"])
    assert slow < 0.5 < 0.588 < fast
    text = invoke("check", path).stdout
    for word in ("mass ratio", "12.57", "10.69", "4.88 m", "50.0 kPa"):
        assert word in text


def test_ship_with_a_valve_and_her_law_are_shown_in_numbers() -> None:
    path = CONFIGS / "ships" / "thesis_first_valve.yaml"
    report = json.loads(invoke("check", path, "--json").stdout)
    assert report["valve_damping_open"] == 0
    assert report["valve_damping_shut"] == pytest.approx(5.6, rel=0.02)
    text = invoke("check", path).stdout
    for word in ("valve in the duct, shut to open", "0.5 s", "10.0%", "0 to 5.6"):
        assert word in text
    law = CONFIGS / "controllers" / "valve_clipped.yaml"
    report = json.loads(invoke("check", law, "--json").stdout)
    assert (report["dissipates"], report["robustness"], report["accepted"]) == (True, None, True)
    assert "can only take energy out of the water" in invoke("check", law).stdout
    assert "dissipates" in invoke("check", CONFIGS / "scenarios" / "semi_active.yaml").stdout


@pytest.mark.slow
def test_scenario_is_recognised_and_shown_with_the_margins_of_all_its_controllers(
    tmp_path: Path,
) -> None:
    gpc, dpc = (CONFIGS / "controllers" / f"{name}.yaml" for name in ("gpc", "dpc"))
    path = scenario(tmp_path, gpc)
    path.write_text(path.read_text().replace("controllers:", f"controllers:\n  two: {dpc}"))
    result = invoke("check", path, "--json")
    assert result.exit_code == 0
    report = json.loads(result.stdout)
    assert report["kind"] == "scenario"
    assert set(report["controllers"]) == {"one", "two"}
    for each in report["controllers"].values():
        assert each["accepted"]
        assert 1 < each["robustness"]["nominal"]["peak_sensitivity"] < 2


@pytest.mark.evidence
def test_a_scenario_with_a_fragile_law_is_refused(tmp_path: Path) -> None:
    fragile = controller(
        tmp_path, "gpc", law__output_weight=[1e16], law__predictor__pressure_noise_pa_rt_s=1e-3
    )
    refused = invoke("check", scenario(tmp_path, fragile), columns=100)
    assert refused.exit_code == 1
    assert "refused" in refused.stdout
    assert "missed by one: " in refused.stdout


def test_scenario_refuses_a_controller_of_another_ship(tmp_path: Path) -> None:
    path = controller(tmp_path, "pd", vessel=str(CONFIGS / "ships" / "naval_vessel.yaml"))
    (_, _, reason), *rest = told(invoke("check", scenario(tmp_path, path)))
    assert "is for another ship, Naval vessel" in reason
    assert not rest


@pytest.mark.parametrize(
    ("actual", "key", "reason"),
    [
        ({"mass_kg": 1.0}, "actual_ship.mass_kg", "it takes inertia_kg_m2, stiffness_nm_rad"),
        ({"inertia_kg_m2": -1.0}, "actual_ship.inertia_kg_m2", "must be above 0"),
        ({"stiffness_nm_rad": 1e7}, "actual_ship", "takes all of the ship's stability"),
        ({"gz_m": 1.0}, "actual_ship.gz_m", "it takes inertia_kg_m2"),
    ],
)
def test_ship_that_a_scenario_changes_is_checked_too(
    tmp_path: Path, actual: dict[str, float], key: str, reason: str
) -> None:
    path = scenario(tmp_path, controller(tmp_path, "pd"))
    path.write_text(path.read_text() + yaml.safe_dump({"actual_ship": actual}))
    ((file, at, why),) = told(invoke("check", path))
    assert (file, at) == (path.name, key)
    assert reason in why


@pytest.mark.evidence
def test_limitless_margins_say_how_far_they_were_searched() -> None:
    path = CONFIGS / "controllers" / "gpc.yaml"
    text = invoke("check", path).stdout
    assert "over 5000 ms" in text
    assert "inf" not in text
    assert "pump gain factor" in text
    report = json.loads(invoke("check", path, "--json").stdout)
    assert report["robustness"]["nominal"]["delay_margin_s"] is None
    assert report["delay_margin_searched_s"] == 5.0


def test_limits_not_written_are_the_vessels(tmp_path: Path) -> None:
    path = controller(tmp_path, "gpc", vessel=str(CONFIGS / "ships" / "patti_b.yaml"))
    limits = load_config(path, ControllerConfig).limits
    vessel = load_config(CONFIGS / "ships" / "patti_b.yaml", Vessel)
    assert limits.pressure_pa == vessel.pump.max_pressure_pa == 20e3
    assert limits.rate_pa_s == 40e3
    assert 0 < limits.level_m < vessel.tank.level_limit_m
    changed = controller(tmp_path, "gpc", limits={"level_m": 3.0})
    limits = load_config(changed, ControllerConfig).limits
    assert (limits.pressure_pa, limits.rate_pa_s, limits.level_m) == (50e3, 100e3, 3.0)


def places(content: Any, key: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Keys of all values in a content."""
    if key:
        yield key
    items: Any = ()
    if isinstance(content, dict):
        items = content.items()
    elif isinstance(content, list):
        items = enumerate(content)
    for name, item in items:
        yield from places(item, (*key, name))


CONTENTS = {
    str(path.relative_to(CONFIGS)): whole(path)
    for path in sorted(CONFIGS.glob("*/*.yaml"))
    if path.parent.name != "ships"
}
VALUES = st.one_of(
    st.floats(),
    st.integers(-(10**400), 10**400),
    st.integers(-5, 300),
    st.none(),
    st.booleans(),
    st.sampled_from(["", "roll_rad", "gpc", "1e12", [], {}, [1.0], [-1.0, 2.0], {"kind": "pd"}]),
)


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_what_loads_can_be_built_and_what_does_not_is_told(tmp_path: Path, data: Any) -> None:
    name = data.draw(st.sampled_from(sorted(CONTENTS)))
    content = copy.deepcopy(CONTENTS[name])
    for _ in range(data.draw(st.integers(1, 2))):
        *parents, last = data.draw(st.sampled_from(list(places(content))))
        place = content
        for parent in parents:
            place = place[parent]
        old = place[last]
        if isinstance(old, float) and data.draw(st.booleans()):
            place[last] = old * data.draw(st.sampled_from([-1, 0.1, 10, 1e6, 1e-6, 1e200]))
        else:
            place[last] = data.draw(VALUES)
    path = tmp_path / "changed.yaml"
    path.write_text(yaml.safe_dump(content))
    try:
        loaded = load_config(path, Scenario if "scenarios" in name else ControllerConfig)
    except ConfigError:
        return
    controllers = [loaded]
    if isinstance(loaded, Scenario):
        build_ship_side(loaded, loaded.seed, loaded.operator)
        controllers = [*loaded.controllers.values()]
    told: list[tuple[str, str]] = []
    for each in controllers:
        work = retuner_work(each)
        retuner = None if work is None else SimulatedRetuner(work[0], 5.0)
        try:
            law = build_law(each)
        except ParameterError as error:
            told += error.problems
        else:
            build_controller_node(each, law, retuner=retuner)
    assert all(key.partition(".")[0] == "law" and reason for key, reason in told)


@pytest.mark.parametrize(
    ("shipped", "changes", "missed"),
    [
        ("feedback_linearization", {"law__level_damping_ratio": 0.0}, "unstable on its own ship"),
        ("feedback_linearization", {"law__frequency_rad_s": 50.0}, "unstable on its own ship"),
        ("fuzzy_robust", {"law__initial": [500.0, 0.0]}, "unstable on its own ship"),
    ],
)
def test_nonlinear_law_that_is_unstable_at_rest_is_refused_unless_the_file_accepts_it(
    tmp_path: Path, shipped: str, changes: dict[str, object], missed: str
) -> None:
    refused = invoke("check", controller(tmp_path, shipped, **changes))
    assert refused.exit_code == 1
    assert missed in refused.stdout
    assert "margins of its slope at rest" in refused.stdout
    assert "remedy: law: {kind: self_tuned} passes" in refused.stdout
    started = invoke("run", controller(tmp_path, shipped, **changes), "--bus", "nowhere0")
    assert started.exit_code == 2
    assert re.search(r"error: \S+\.yaml: .*: the law misses its margins", started.stderr)
    accepted = invoke("check", controller(tmp_path, shipped, **changes, accept_low_margins=True))
    assert accepted.exit_code == 0
    assert "accepted by the configuration" in accepted.stdout


@pytest.mark.evidence("1230000000000.0-False")
@pytest.mark.slow
@pytest.mark.parametrize(("weight", "hardly"), [(1e-6, True), (1.23e12, False)])
def test_law_that_hardly_acts_is_told_so(tmp_path: Path, weight: float, hardly: bool) -> None:
    text = invoke("check", controller(tmp_path, "gpc", law__output_weight=[weight])).stdout
    assert "All requirements are met." in text
    assert ("It hardly acts" in text) == hardly


@pytest.mark.parametrize("shipped", ["feedback_linearization", "fuzzy_robust"])
def test_shipped_nonlinear_law_has_the_margins_that_are_required(shipped: str) -> None:
    path = CONFIGS / "controllers" / f"{shipped}.yaml"
    report = json.loads(invoke("check", path, "--json").stdout)
    assert report["accepted"]
    assert report["failures"] == []
    assert report["robustness"]["nominal"]["radius"] < 1
    assert ("parameters it starts from" in report["at_rest"]) == (shipped == "fuzzy_robust")


def test_a_period_by_formula_is_said(tmp_path: Path) -> None:
    path = tmp_path / "hull.yaml"
    path.write_text(
        "name: hull\n"
        "ship: {displacement_t: 1900, gm_m: 0.9, beam_m: 10, draught_m: 3.2, length_m: 60}\n"
        "tank: {width_m: 8, height_m: 1.6, reservoir_area_m2: 6, duct_area_m2: 1.2, "
        "damping_ratio: 0.1}\n"
    )
    done = CliRunner().invoke(app, ["check", str(path)])
    assert done.exit_code == 0, done.output
    assert "Assumed: ship: roll period 8.8 s by the weather criterion" in done.stdout
    told = json.loads(CliRunner().invoke(app, ["check", str(path), "--json"]).stdout)
    assert told["pump_heel_rad"] is None
    assert told["assumptions"][0].startswith("ship: roll period 8.8 s")


def test_two_losses_of_a_tank_that_loses_quadratically_are_named(tmp_path: Path):
    content = yaml.safe_load((CONFIGS / "ships" / "thesis_first.yaml").read_text())
    content["tank"] |= {"damping_ratio": 0.02, "quadratic_loss": 4.0}
    (tmp_path / "ship.yaml").write_text(yaml.safe_dump(content))
    path = controller(tmp_path, "pd", vessel="./ship.yaml")
    found = invoke("check", path)
    said = re.search(r"damping ratio is (0\.\d+) in waves, 0.02 in", found.stdout)
    assert said
    assert float(said[1]) > 0.03
    assert "two tanks" not in invoke("check", controller(tmp_path, "pd")).stdout


def test_an_eigenvalue_below_one_is_not_shown_as_one() -> None:
    words = [radius_words(each) for each in (0.99812, 0.99998, 1.00003, 1.0045)]
    assert words == ["0.9981", "1 - 2e-05", "1 + 3e-05", "1.0045"]


def test_what_comes_next_is_what_this_machine_can_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def following(path: Path) -> list[str]:
        return invoke("check", path).stdout.partition("Next:\n  ")[2].splitlines()

    pd = controller(tmp_path, "pd")
    net = tmp_path / "net"
    monkeypatch.setattr(terminal, "INTERFACES", net)
    assert following(pd) == []
    (tmp_path / "scenario.yaml").write_text("controllers: {other: gpc.yaml}\n")
    assert following(pd) == []
    (tmp_path / "scenario.yaml").write_text(f"controllers: {{mine: {pd.name}}}\n")
    for name, kind in (("can3", 280), ("eth0", 1), ("vcan1", 280)):
        (net / name).mkdir(parents=True)
        (net / name / "type").write_text(f"{kind}\n")
    bench, run = following(pd)
    assert bench == f"utank-hil bench {tmp_path / 'scenario.yaml'}"
    assert run == f"  utank-hil run {pd} --bus can3"
    allowed = invoke("check", pd, "--allow-code").stdout.splitlines()[-2:]
    assert allowed == [f"{bench:>{len(bench) + 2}} --allow-code", f"{run} --allow-code"]
    own = {"kind": "python", "factory": "./own.py:Law", "measured": ["roll_rad"]}
    content = yaml.safe_load(pd.read_text()) | {"law": own}
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(content))
    (tmp_path / "scenario.yaml").write_text(f"controllers: {{mine: {pd.name}, own: own.yaml}}\n")
    assert following(pd) == [run.strip()]  # the bench would ask for --allow-code
