"""Small studies for tests."""

from pathlib import Path

import yaml

from firmware_sim.campaign.study import load_study

CONFIGS = Path("configs").resolve()
SHORT = {"duration_s": 30.0, "settle_s": 10.0}


def written(folder, **keys):
    """A study file of the storm with GPC alone."""
    scenario = {"scenario": str(CONFIGS / "scenarios" / "storm.yaml"), "simulation": "linear"}
    controllers = {"gpc": str(CONFIGS / "controllers" / "gpc.yaml")}
    content = {"name": "test", **scenario, **keys}
    content["set"] = {**SHORT, "controllers": controllers, **content.get("set", {})}
    path = folder / "study.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def small(folder, **keys):
    """The same, loaded."""
    return load_study(written(folder, **keys))
