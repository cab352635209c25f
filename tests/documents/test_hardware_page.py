"""docs/how-to/hardware.md: its commands are valid; tests/socketcan/test_stand_in.py runs them."""

import math
import re
import runpy
import shlex
from pathlib import Path

import cantools
import pytest
import typer
from typer.testing import CliRunner

from firmware_sim.cli import app as ship_app
from utank_hil.canbus import Fault, Frame, Quality, load_catalogue
from utank_hil.canbus.messages import DBC_NAMES
from utank_hil.cli import app
from utank_hil.configuration import Vessel, load_config
from utank_hil.console.exit_codes import ExitCode

PAGE = Path("docs/how-to/hardware.md")
TEXT = PAGE.read_text(encoding="utf-8")
PROGRAMS = r"(?:firmware-sim|python docs|utank-hil)"
COMMANDS = [
    *re.findall(rf"^{PROGRAMS}.*$", TEXT, re.M),  # of the block
    *re.findall(rf"`({PROGRAMS}[^`]* --bus [^`]*)`", TEXT),  # in sentences
]
APPS = {"firmware-sim": ship_app, "utank-hil": app}


def test_the_page_has_commands():
    assert len(COMMANDS) == 5


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_of_the_page_gets_as_far_as_the_bus(command):
    program, *words = shlex.split(re.sub(r"--bus \w+", "--bus nowhere0", command))
    for word in words:
        if word.startswith(("configs/", "docs/")):
            assert Path(word).is_file(), word
    if program == "python":
        assert words[0] == "docs/how-to/sensors.py"
        return
    application: typer.Typer = APPS[program]
    result = CliRunner(env={"TERM": "dumb", "COLUMNS": "200"}).invoke(application, words)
    assert result.exit_code == ExitCode.NO_BUS
    assert "nowhere0: not found" in result.stderr


def test_the_version_in_the_page_is_that_of_the_ship_and_the_faults_exist():
    version = load_config("configs/ships/thesis_first.yaml", Vessel).version
    assert f"--configuration {version}\n" in TEXT
    table = TEXT.partition("| fault shown | cause |")[2].split("## ")[0]
    names = re.findall(r"[A-Z_]{6,}", "".join(re.findall(r"^\|([^|]*)\|", table, re.M)))
    assert len(names) == 6
    assert set(names) <= set(Fault.__members__)


def test_links_of_the_page_lead_somewhere():
    for link in re.findall(r"\]\(([^)#]+)", TEXT):
        assert (PAGE.parent / link).is_file(), link


def test_the_stand_in_s_frames_are_accepted():
    script = runpy.run_path("docs/how-to/sensors.py")
    catalogue, database = load_catalogue(), cantools.database.load_file(script["DBC"])
    assert script["catalogue_version"]() == catalogue.version
    names = {name: kind for kind, name in DBC_NAMES.items()}
    for name, signals in script["measurements"](3.0).items():
        receiver, message = catalogue.receiver(names[name]), database.get_message_by_name(name)
        for counter in (*range(1, 16), 0):
            data = script["protected"](message, signals, counter)
            heard = receiver.accept(Frame(message.frame_id, data))
            assert heard.quality is Quality.GOOD
        if name == "SENSOR_MOTION":
            assert heard.roll_rad == pytest.approx(math.radians(1), abs=1e-4)
        assert receiver.valid
