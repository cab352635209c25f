"""The peers' lock: complete, hashed, on the project's own versions, and lean."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PEERS = ROOT / "tools" / "peers"


def pinned(path):
    """Requirement lines by name, hashes left out."""
    entry = r"^([a-z0-9-]+)(?:\[[a-z0-9,-]+\])?==(\S+)( ; [^\\\n]*)?"
    lines = re.findall(entry, path.read_text(), re.MULTILINE)
    found: dict[str, set[tuple[str, str]]] = {}
    for name, version, marker in lines:
        found.setdefault(name, set()).add((version, marker.strip()))
    return found


def test_what_both_pin_has_the_same_version():
    ours, theirs = pinned(ROOT / "requirements.lock"), pinned(PEERS / "requirements.lock")
    both = set(ours) & set(theirs)
    assert {"numpy", "scipy", "matplotlib"} <= both
    versions = {name: {version for version, _ in theirs[name]} for name in both}
    assert all(versions[name] <= {version for version, _ in ours[name]} for name in both)


def test_everything_asked_for_is_pinned_and_nothing_heavy_came_along():
    theirs = pinned(PEERS / "requirements.lock")
    asked = re.findall(r"^([a-z_-]+)", (PEERS / "requirements.in").read_text(), re.MULTILINE)
    assert {name.replace("_", "-") for name in asked} <= set(theirs)
    heavy = [
        name for name in theirs if re.match(r"torch|nvidia|jax|tensorflow|opensees|gmsh", name)
    ]
    assert heavy == []


def test_every_pin_has_a_hash_and_no_registry_is_named():
    text = (PEERS / "requirements.lock").read_text()
    blocks = re.split(r"^(?=\S)", text, flags=re.MULTILINE)[1:]
    assert all("--hash=sha256:" in block for block in blocks)
    assert "://" not in text
    assert "--index" not in text
