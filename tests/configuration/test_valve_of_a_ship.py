"""The section `valve` of a ship file."""

from pathlib import Path

import pytest
import yaml

from utank_hil.configuration import ConfigError, Vessel, load_config

SHIPS = Path("configs/ships")


def ship(folder, **valve):
    """The shipped ship with a valve, with keys of it changed or, with None, left out."""
    content = yaml.safe_load((SHIPS / "thesis_first_valve.yaml").read_text(encoding="utf-8"))
    changed = content["valve"] | valve
    content["valve"] = {key: value for key, value in changed.items() if value is not None}
    path = folder / "ship.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"leakage": 1e-3}, "valve.leakage: would stop the water within 1 ms, as a closed one"),
        ({"kind": "air"}, "valve.pipe_area_m2: is required but missing: kind is air"),
        ({"kind": "air", "pipe_area_m2": 1e-4}, "valve.pipe_area_m2: would stop the water"),
        ({"kind": "gate"}, "valve.kind: "),
        ({"opening_time_s": None}, "valve.opening_time_s: is required but missing"),
        ({"opening_time_s": 0}, "valve.opening_time_s: must be 0.05 to 60"),
        ({"fail_position": "middle"}, "valve.fail_position: "),
        ({"leak": 0.1}, "valve.leak: is not a known key"),
    ],
)
def test_a_wrong_valve_is_told_at_its_key(tmp_path, changes, problem):
    with pytest.raises(ConfigError) as caught:
        load_config(ship(tmp_path, **changes), Vessel)
    (line,) = str(caught.value).splitlines()
    assert problem in line


def test_the_nodes_compare_the_valve_too(tmp_path):
    vessel = load_config(ship(tmp_path), Vessel)
    assert load_config(ship(tmp_path, opening_time_s=0.6), Vessel).version != vessel.version
    assert vessel.model_copy(update={"valve": None}).version != vessel.version
