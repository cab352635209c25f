"""The list of parts, and a controller that has no others."""

import subprocess
import sys
from importlib.metadata import version

import pytest
from packaging.requirements import Requirement

from tools.sbom import closure, locked, sbom

CONTROLLER = """
import sys
from importlib.abc import MetaPathFinder
from importlib.metadata import packages_distributions

listed, owners = set(sys.argv[1:]), packages_distributions()

class OnlyListed(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        its = owners.get(name.partition(".")[0], ())
        parts = {owner.lower().replace("_", "-") for owner in its}
        if parts and not parts & listed:
            raise ModuleNotFoundError(name, name=name)

sys.meta_path.insert(0, OnlyListed())
import utank_hil.cli, utank_hil.commands.run, utank_hil.commands.check, utank_hil.commands.panel
from utank_hil.assembly import build_controller_node
from utank_hil.configuration import ControllerConfig, load_config
config = load_config("configs/controllers/constrained_gpc.yaml", ControllerConfig)
list(build_controller_node(config).tick(0))
"""


@pytest.mark.evidence
def test_with_the_listed_parts_alone_a_controller_runs():
    made = sbom()
    assert (made["bomFormat"], made["metadata"]["component"]["name"]) == ("CycloneDX", "utank-hil")
    listed = {part["name"].lower(): part for part in made["components"]}
    subprocess.run(
        [sys.executable, "-c", CONTROLLER, "utank-hil", *listed], check=True, timeout=120
    )
    for name, part in listed.items():
        assert part["version"] == version(name)
        assert part["externalReferences"][0]["hashes"]
    assert not listed.keys() & {"matplotlib", "numba", "rerun-sdk", "pytest", "control", "pyarrow"}
    assert set(listed) == closure(frozenset()).keys() - {"utank-hil"}
    graph = {entry["ref"]: entry["dependsOn"] for entry in made["dependencies"]}
    root = graph[made["metadata"]["component"]["bom-ref"]]
    assert listed["numpy"]["bom-ref"] in root
    assert listed["numpy"]["bom-ref"] in graph[listed["scipy"]["bom-ref"]]


def test_without_one_of_them_it_does_not():
    listed = closure(frozenset()).keys() - {"annotated-types"}  # which a part of a part needs
    done = subprocess.run(
        [sys.executable, "-c", CONTROLLER, *listed], check=False, timeout=120, capture_output=True
    )
    assert b"ModuleNotFoundError" in done.stderr


def test_an_extra_brings_its_parts_and_only_its_own():
    parts = closure(frozenset({"viewer"}))
    assert "rerun-sdk" in parts
    assert "matplotlib" not in parts


def test_a_part_that_the_lock_lacks_is_named():
    assert "numpy==" in locked({"numpy"})
    with pytest.raises(SystemExit, match="lacks numppy, skippy"):
        locked({"numpy", "numppy", "skippy"})


def test_the_lock_of_a_ships_pc_has_the_listed_parts_with_hashes_and_pip_takes_it(tmp_path):
    command = [sys.executable, "-m", "tools.sbom", "--extra", "viewer", "--lock"]
    text = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    entries = [entry for entry in text.splitlines() if not entry.startswith(" ")]
    pinned = {Requirement(entry.rstrip("\\ ")).name: entry for entry in entries}
    assert pinned.keys() == closure(frozenset({"viewer"})).keys() - {"utank-hil"}
    assert all("==" in entry for entry in entries)
    # no part asks for an extra of another; one that stays would ask for packages without hashes
    assert [entry for entry in entries if "[" in entry] == []
    file = tmp_path / "requirements.txt"
    file.write_text(text)
    install = ["-m", "pip", "install", "--dry-run", "--no-index", "--require-hashes", "-r"]
    done = subprocess.run(
        [sys.executable, *install, str(file)], check=True, stdout=subprocess.PIPE, text=True
    )
    assert "Would install" not in done.stdout
