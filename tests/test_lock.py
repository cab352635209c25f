"""The lock of the project: what pip, as Debian has it, installs from it today and next year."""

import re
from importlib.metadata import distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

LOCK = Path(__file__).resolve().parents[1] / "requirements.lock"


@pytest.fixture(scope="module")
def extras():
    """Extras in the lock by package, of the entries that hold on this machine."""
    entries = [
        Requirement(line.partition("\\")[0].strip())
        for line in LOCK.read_text(encoding="utf-8").splitlines()
        if re.match(r"[a-zA-Z0-9]", line)
    ]
    return {
        canonicalize_name(entry.name): entry.extras
        for entry in entries
        if entry.marker is None or entry.marker.evaluate()
    }


def test_extras_that_a_locked_package_asks_for_are_in_the_lock(extras):
    """Without them pip 23.2 takes the newest release, which has no hash here, and refuses it."""
    asked = {
        (canonicalize_name(wanted.name), extra)
        for name, own in extras.items()
        for wanted in map(Requirement, distribution(name).requires or ())
        for extra in wanted.extras
        if wanted.marker is None
        or any(wanted.marker.evaluate({"extra": group}) for group in {"", *own})
    }
    assert ("coverage", "toml") in asked
    assert {(name, extra) for name, extra in asked if extra not in extras[name]} == set()


def test_every_pin_has_a_hash_and_no_registry_is_named():
    text = LOCK.read_text(encoding="utf-8")
    blocks = re.split(r"^(?=\S)", text, flags=re.MULTILINE)[1:]
    assert len(blocks) > 100
    assert all("--hash=sha256:" in block for block in blocks)
    assert "://" not in text
