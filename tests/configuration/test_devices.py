"""Section `devices` of a ship's file: what it refuses, and what it changes."""

import re
from pathlib import Path

import pytest
import yaml
from others import others_file

from utank_hil.canbus.profiles.device_plan import ForeignDevices
from utank_hil.configuration import ControllerConfig, Vessel
from utank_hil.configuration.device_files import shipped_profiles
from utank_hil.configuration.devices import DevicesSection
from utank_hil.configuration.files import ConfigError, load_config

SHIP = Path("configs/ships/thesis_first.yaml").resolve()
SBG = {"profile": "sbg_ellipse", "accept_unprotected": True}


def ship_file(folder, devices, **more):
    content = yaml.safe_load(SHIP.read_text()) | more
    if devices is not None:
        content["devices"] = devices
    path = folder / "ship.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def ship(folder, devices, **more):
    return load_config(ship_file(folder, devices, **more), Vessel)


def problems(folder, devices, **more):
    with pytest.raises(ConfigError) as refused:
        ship(folder, devices, **more)
    return str(refused.value)


def test_without_the_section_the_version_is_as_it_was(tmp_path):
    assert ship(tmp_path, None).version == load_config(SHIP, Vessel).version


def test_a_change_of_a_device_voids_the_commissioning(tmp_path):
    versions = {
        ship(tmp_path, devices).version
        for devices in (
            None,
            {"motion": SBG},
            {"motion": SBG | {"bus": "can1"}},
            {"motion": SBG | {"latency_ms": 9}},
            {"motion": SBG | {"signals": {"roll_rad": {"sign": -1}}}},
            {"motion": SBG | {"messages": {"attitude": {"id": 0x133}}}},
        )
    }
    assert len(versions) == 6


@pytest.mark.parametrize(
    ("devices", "reason"),
    [
        ({"motion": {"profile": "sbg"}}, "no profile 'sbg': there are native, cia404_levels"),
        ({"motion": {"profile": "sbg_ellipse"}}, "accept_unprotected: must be set to true"),
        ({"motion": SBG | {"cycle_ms": 100, "age_ms": 300}}, "10 Hz: too slow"),
        ({"motion": SBG | {"age_ms": 10}}, "must be 20 or more, two cycles"),
        ({"motion": SBG | {"protection": {"stamps": []}}}, "unchanged_ms"),
        ({"motion": {"profile": "cia410", "node": 4, "accept_unprotected": True}}, "is derived"),
        ({"motion": {"profile": "cia410", "accept_unprotected": True}}, "motion.node"),
        ({"motion": {"profile": "n2k_attitude", "source": 3, "accept_unprotected": True}}, "10 Hz"),
        ({"motion_2": SBG}, "second_motion_sensor: true"),
        ({"motion": SBG | {"signals": {"roll_rad": {"from": "attitude.YAW"}}}}, "is no signal"),
        ({"motion": SBG | {"signals": {"heave_m": {"from": "attitude.ROLL"}}}}, "is no value"),
        ({"motion": {"bus": "can1"}}, "native nodes"),
        ({"motion": SBG, "receive_only": ["can3"]}, "no device is on can3"),
        ({"motion": SBG | {"dbc": "./none.dbc", "messages": {"a": "B"}}}, "can't be read"),
        ({"motion": {"sources": 5}}, "did you mean source"),
    ],
)
def test_what_is_refused(tmp_path, devices, reason):
    assert reason in problems(tmp_path, devices)


@pytest.mark.parametrize(
    "content", [b"\x01", b'VERSION "', b"BO_ 99999999999999999999 A: 8 B\n", b"SG_ : 1", bytes(9)]
)
def test_a_damaged_dbc_is_refused_by_its_name(tmp_path, content):
    (tmp_path / "theirs.dbc").write_bytes(content)
    motion = SBG | {"dbc": "./theirs.dbc", "messages": {"a": "B"}}
    assert re.search(
        r"theirs\.dbc (is no DBC|has no message)", problems(tmp_path, {"motion": motion})
    )


def test_a_motion_signal_without_unit_is_refused(tmp_path):
    slope = {"id": 5, "signals": {"S": {"start": 0, "bits": 16}, "R": {"start": 16, "bits": 16}}}
    device = {
        "profile": "", "messages": {"slope": slope}, "cycle_ms": 10, "age_ms": 40,
        "signals": {"roll_rad": {"from": "slope.S"}, "roll_rate_rad_s": {"from": "slope.R"}},
        "accept_unprotected": True, "protection": {"unchanged_ms": 500},
    }  # fmt: skip
    assert "slope.S has no unit: give scale, from it to rad" in problems(
        tmp_path, {"motion": device}
    )
    device["signals"]["roll_rad"]["scale"] = device["signals"]["roll_rate_rad_s"]["scale"] = 1e-3
    assert ship(tmp_path, {"motion": device}).devices.motion.step("roll_rad") == 1e-3


def test_every_shipped_profile_is_cited_and_usable(tmp_path):
    needs = {"j1939_ssi2": {"source": 0x20}, "cia410": {"node": 3}, "cia404_levels": {"node": 9}}
    scaled = {name: {"scale": 0.25, "offset": -3} for name in ("port_level_m", "starboard_level_m")}
    needs["n2k_attitude"] = {"source": 0x20, "cycle_ms": 50}
    needs["cia404_levels"] |= {"signals": scaled, "high_level_m": 4.6}
    both = {"redundancy": {"second_motion_sensor": True}}
    for name in shipped_profiles():
        role = "levels" if "levels" in name else "motion"
        device = {"profile": name, "accept_unprotected": True, **needs.get(name, {})}
        found = ship(tmp_path, {role: device}, **both)
        section = getattr(found.devices, role)
        assert section.device
        assert section.documents
        assert getattr(found.devices.foreign(), "levels" if role == "levels" else "motions")


def test_a_slow_sensor_is_refused_by_the_delay_of_the_law_with_the_number(tmp_path):
    ship_file(tmp_path, {"motion": SBG | {"cycle_ms": 50, "age_ms": 120}})
    law = {"name": "c", "vessel": "ship.yaml", "law": {"kind": "pd"}}
    law |= yaml.safe_load(Path("configs/controllers/pd.yaml").read_text())
    law["vessel"] = "ship.yaml"
    path = tmp_path / "c.yaml"
    path.write_text(yaml.safe_dump(law | {"delay_s": 0.05}))
    with pytest.raises(
        ConfigError, match=r"58 ms late.*of 23.8 Hz or more, or set delay_s to 0.058"
    ):
        load_config(path, ControllerConfig)
    path.write_text(yaml.safe_dump(law | {"delay_s": 0.06}))
    config = load_config(path, ControllerConfig)
    assert config.safety.motion_age_ms == 120
    assert config.sensor_figures.roll_rate_noise_rad_s == pytest.approx(5e-4)


def test_a_ship_that_was_written_out_is_read_again(tmp_path):
    messages = {"a": "SBG_ECAN_MSG_EKF_EULER", "g": "SBG_ECAN_MSG_IMU_GYRO"}
    of_a_file = {
        "dbc": str(others_file("devices/dbc/sbgCan.dbc")), "messages": messages,
        "signals": {"roll_rad": {"from": "a.ROLL"}, "roll_rate_rad_s": {"from": "g.GYRO_X"}},
        "cycle_ms": 10, "age_ms": 40, "accept_unprotected": True,
        "protection": {"unchanged_ms": 100},
    }  # fmt: skip
    for motion in (SBG, of_a_file):
        found = ship(tmp_path, {"motion": motion}).devices
        for mode in ("json", "python"):
            assert DevicesSection.model_validate(found.model_dump(mode=mode)) == found


def test_the_noisier_gauge_counts_and_noise_of_no_value_is_refused(tmp_path):
    levels = {"profile": "cia404_levels", "accept_unprotected": True, "node": 9,
              "high_level_m": 4.6, "noise": {"starboard_level_m": 0.03},
              "signals": {name: {"scale": 0.25, "offset": -3}
                          for name in ("port_level_m", "starboard_level_m")}}  # fmt: skip
    ship_file(tmp_path, {"levels": levels})
    content = yaml.safe_load(Path("configs/controllers/pd.yaml").read_text())
    path = tmp_path / "c.yaml"
    path.write_text(yaml.safe_dump(content | {"vessel": "ship.yaml"}))
    assert load_config(path, ControllerConfig).sensor_figures.level_noise_m == 0.03
    said = problems(tmp_path, {"levels": levels | {"noise": {"level_m": 0.03}}})
    assert "devices.levels.noise.level_m: is no value of it; there are port_level_m" in said


def test_coarse_steps_are_noise():
    section = {"signals": {"roll_rate_rad_s": {"scale": 0.01}}}
    devices = DevicesSection(motion=SBG | section)
    assert devices.noise("motion", "roll_rate_rad_s") == pytest.approx(1e-5 / 12**0.5)


@pytest.mark.parametrize(
    ("can_id", "known"),
    [
        (0x0DF11313, True),  # any priority and source
        (0x15F11301, True),
        (0x0DF11413, False),
        (0x18EA80FE, True),  # PGN 59904, to one
        (1 << 29 | 0x321, True),
        (0x321, False),
    ],
)
def test_declared_devices_are_known(can_id, known):
    others = ForeignDevices(
        other_ids=frozenset([1 << 29 | 0x321]), other_pgns=frozenset([0x1F113, 0xEA00])
    )
    assert others.knows(can_id) is known
