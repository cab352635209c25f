"""Each physical quantity of each shipped file, times 0.001, 10, 60 and 1000: none passes unnamed.

What is refused or warned of names the key, as its place or in its words: of two quantities that
do not fit each other, either may be wrong.
"""

import copy
from pathlib import Path
from typing import Final

import pytest
import yaml

from firmware_sim.scenario import Scenario
from utank_hil.configuration import ConfigError, ControllerConfig, Vessel, load_config
from utank_hil.configuration.yaml_text import parse_yaml

CONFIGS = Path("configs").resolve()
KINDS = {"ships": Vessel, "controllers": ControllerConfig, "scenarios": Scenario}
FACTORS: Final = (0.001, 10, 60, 1000)
Place = tuple[str | int, ...]

INIT_SHIP: Final = {  # as `init --length 90 --beam 14 --displacement 1900 --gm 1.1` writes it
    "name": "OPV",
    "ship": {"displacement_t": 1900.0, "gm_m": 1.1, "roll_period_s": 11.0, "damping_ratio": 0.05},
    "tank": {"width_m": 10.08, "height_m": 2.569, "reservoir_area_m2": 6.172,
             "duct_area_m2": 1.143, "lz_m": 1.4, "damping_ratio": 0.2467, "headroom_m": 2.569},
    "pump": {"max_pressure_pa": 11760.0, "max_power_w": 68440.0},
}  # fmt: skip

TUNED: Final = {
    # counts and shares of a law's tuning, and white noise that stands for what a model leaves out:
    # any value makes a law, and the gate judges its loop
    "order", "prediction_horizon", "output_weight", "state_weight", "measurement_std",
    "pressure_noise_pa_rt_s", "slope_noise_rad_rt_s", "pressure_weight_rad2",
    "level_weight_rad2_m2", "level_margin_m", "heel_std_rad", "heel_time_s", "floor",
    "smoothing_rad_s", "q", "ranges", "gain_rad_s2_pa", "gamma", "epsilon", "adaptation",
    "leakage", "brake_share", "sharpness", "control_horizon", "first_output",
    "change_factor", "trial_s", "roll_factor", "wave_damping_ratio",
    # instants and lengths of a run, of which any is a run; those after the end are warned of
    "seed", "time_s", "duration_s", "settle_s", "actual_from_s",
}  # fmt: skip

NOT_TOLD: Final = {
    # still water has no waves whose period could be wrong
    "still_water.sea.period_s": {0.001}, "stimulation.sea.period_s": {0.001},
    # a thousandth of an angle is an angle
    "heading_deg": {0.001}, "course_deg": {0.001},
    # Patti-B, with 0.002, is damped so little that 60 times it is a usual hull
    "patti_b.ship.damping_nms_rad": {10, 60},
    # ten times these is what other hulls have
    "patti_b.ship.quadratic_damping_nms2_rad2": {10},
    "naval_vessel.ship.quadratic_damping_nms2_rad2": {10},
    "naval_vessel.ship.restoring_odd_nm": {10},
    # 0.05 for a tank without throttle; 0.5 is one throttled much
    "thesis_first_valve.tank.damping_ratio": {10},
    # another node of the bus
    "thesis_first_devices.devices.pump.node": {10},
    # drives count speeds from a thousandth of a rev/min to one
    "thesis_first_devices.devices.pump.speed_rad_s_per_unit": {0.001, 10},
    # from perfect to an error of five times the waves, a forecast is one
    "preview.preview.error": {0.001, 10},
    # ten times a ripple at the quay is a sea, and ten times a container heavy cargo
    "heel_removal.sea.hs_m": {10},
    **{f"heel_removal.voyage.{at}.ship.offset_moment_nm": {10} for at in range(1, 6)},
    # emulated gauges are as noisy as one wants to try
    "patti_b.sensors.level_noise_m": {0.001, 10, 60, 1000},
    # small ships in a small sea: three to eight times its height is a usual sea
    "naval_constrained_gpc.law.sea.density_m2_hz": {10, 60},
    "patti_b_constrained_gpc.law.sea.density_m2_hz": {10},
}  # fmt: skip


def quantities(content, at=()):
    """Places of the numbers of a file that are neither zero nor tuning; a list is one."""
    items = content.items() if isinstance(content, dict) else ()
    if isinstance(content, list) and content and isinstance(content[0], dict):
        items = enumerate(content)
    elif isinstance(content, list) and content and isinstance(content[0], int | float):
        yield at
    for key, value in items:
        if isinstance(value, int | float) and not isinstance(value, bool) and value != 0:
            yield (*at, key)
        else:
            yield from quantities(value, (*at, key))


def scaled(content, at, factor):
    changed = copy.deepcopy(content)
    part = changed
    for key in at[:-1]:
        part = part[key]
    old = part[at[-1]]
    part[at[-1]] = [factor * each for each in old] if isinstance(old, list) else factor * old
    return changed


def with_paths(content, folder):
    if isinstance(content, dict):
        return {key: with_paths(value, folder) for key, value in content.items()}
    if isinstance(content, str) and (folder / content).is_file():
        return str((folder / content).resolve())
    return content


def told(folder, content, model):
    file = folder / "changed.yaml"
    file.write_text(yaml.safe_dump(content))
    try:
        return dict(load_config(file, model).warnings())
    except ConfigError as error:
        return {problem.key: problem.reason for problem in error.problems}


def unnamed(folder, stem, content, model):
    """Changes of a quantity that no refusal or warning names."""
    usual, found = told(folder, content, model), []
    for at in quantities(content):
        leaf = next(key for key in reversed(at) if isinstance(key, str))
        place = ".".join(map(str, (stem, *at)))
        excepted = NOT_TOLD.get(place, NOT_TOLD.get(leaf, set()))
        for factor in FACTORS if leaf not in TUNED else ():
            new = {
                key: words
                for key, words in told(folder, scaled(content, at, factor), model).items()
                if usual.get(key) != words
            }
            named = any(leaf in key.split(".") or leaf in words for key, words in new.items())
            assert not (named and factor in excepted and leaf not in NOT_TOLD), (place, factor)
            if not named and factor not in excepted:
                found.append(f"{place} times {factor}: {new}")
    return found


@pytest.mark.parametrize("ship", [*sorted(CONFIGS.glob("ships/*.yaml")), None], ids=str)
def test_no_quantity_of_a_ship_passes_by_a_factor(tmp_path, ship):
    stem = "init" if ship is None else ship.stem
    content = INIT_SHIP if ship is None else parse_yaml(ship.read_text())[0]
    assert unnamed(tmp_path, stem, content, Vessel) == []


@pytest.mark.evidence(
    "voyage",
    "adaptive_gpc",
    "patti_b_constrained_gpc",
    "self_tuned",
    "gpc",
    "valve_clipped",
    "adaptive_dpc",
    "dpc",
    "constrained_gpc",
    "adaptive_dpc_roll",
    "valve_on_off",
    "naval_constrained_gpc",
    "load_change",
    "patti_b",
    "adaptive",
    "naval_vessel",
)
@pytest.mark.slow
@pytest.mark.parametrize(
    "file",
    [*CONFIGS.glob("controllers/*.yaml"), *CONFIGS.glob("scenarios/*.yaml")],
    ids=lambda path: path.stem,
)
def test_no_quantity_of_a_law_or_sea_passes_by_a_factor(tmp_path, file):
    content = with_paths(parse_yaml(file.read_text())[0], file.parent)
    if "controllers" in content:  # one of them is enough: the sea is judged
        name, controller = next(iter(content["controllers"].items()))
        content["controllers"] = {name: controller}
    assert unnamed(tmp_path, file.stem, content, KINDS[file.parent.name]) == []
