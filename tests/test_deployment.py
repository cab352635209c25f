"""The files of deploy/: fit for systemd, and in step with the program."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from utank_hil.base.tick import TICK_NS
from utank_hil.cli import app
from utank_hil.configuration import ControllerConfig
from utank_hil.console.exit_codes import ExitCode
from utank_hil.runners import beside
from utank_hil.runners.process_priority import PRIORITY

DEPLOY = Path("deploy").resolve()
UNIT = DEPLOY / "utank-hil.service"
INSTALLED = "/opt/utank-hil/bin/utank-hil"
GPC = "configs/controllers/gpc.yaml"
MOST_EXPOSURE = 2.0
NETWORKD = Path("/usr/lib/systemd/systemd-networkd")


def entries(path):
    """Section, key and value of each line."""
    found, section = [], ""
    for line in path.read_text(encoding="utf-8").splitlines():
        if line.startswith("["):
            section = line.strip("[]")
        elif line and not line.startswith("#"):
            key, _, value = line.partition("=")
            found.append((section, key, value))
    return found


def value(key, path=UNIT):
    (found,) = [value for _, name, value in entries(path) if name == key]
    return found


def systemd_analyze(*words, unit):
    """Run it, or skip where there is none; where CI runs, it must be there."""
    program = shutil.which("systemd-analyze")
    if program is None:
        assert "UTANK_HIL_CI" not in os.environ, (
            "systemd-analyze is missing: apt-get install systemd"
        )
        pytest.skip("no systemd-analyze: apt-get install systemd")
    return subprocess.run(
        [program, *words, unit], capture_output=True, text=True, timeout=60, check=False
    )


@pytest.fixture
def unit(tmp_path):
    """The unit with a program that is there."""
    path = tmp_path / UNIT.name
    path.write_text(
        UNIT.read_text().replace(INSTALLED, str(Path(sys.executable).parent / "utank-hil"))
    )
    return path


def test_systemd_finds_nothing_wrong_with_the_unit(unit):
    done = systemd_analyze("verify", "--man=no", unit=unit)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


def test_systemd_finds_what_is_wrong_with_another(unit):
    unit.write_text(unit.read_text().replace("WatchdogSec=500ms", "WatchdogSecs=soon"))
    done = systemd_analyze("verify", "--man=no", unit=unit)
    assert "WatchdogSecs" in done.stdout + done.stderr


def test_exposure_is_what_the_document_says_and_no_more_than_asked_for(unit):
    threshold = f"--threshold={10 * MOST_EXPOSURE:.0f}"
    done = systemd_analyze("security", "--offline=true", "--no-pager", threshold, unit=unit)
    assert done.returncode == 0, done.stdout
    found = re.search(r"Overall exposure level for utank-hil.service: (\S+)", done.stdout)
    assert found
    assert float(found[1]) <= MOST_EXPOSURE
    assert f"exposure {found[1]}" in Path("docs/deployment.md").read_text(encoding="utf-8")
    unit.write_text(unit.read_text().replace("CapabilityBoundingSet=\n", ""))
    assert systemd_analyze(
        "security", "--offline=true", "--no-pager", threshold, unit=unit
    ).returncode


def test_commands_of_the_unit_are_those_of_the_program():
    codes = {}
    for key in ("ExecStartPre", "ExecStart"):
        program, *words = shlex.split(value(key))
        assert program == {"ExecStartPre": f"-{INSTALLED}", "ExecStart": INSTALLED}[key]
        shown = [
            {"/etc/utank-hil/controller.yaml": GPC, "can0": "nowhere0"}.get(w, w) for w in words
        ]
        assert len(set(shown) - set(words)) == {"ExecStartPre": 1, "ExecStart": 2}[key]
        codes[key] = CliRunner().invoke(app, shown).exit_code
    # it gets as far as the bus
    assert codes == {"ExecStartPre": ExitCode.OK, "ExecStart": ExitCode.NO_BUS}


def test_unit_is_in_step_with_the_program():
    assert value("Type") == "notify"
    assert value("Restart") == "on-failure"
    # stopped by whoever, also with a fault latched
    never = (ExitCode.USAGE, ExitCode.BUS_LOST, ExitCode.FAULT)
    assert value("RestartPreventExitStatus") == " ".join(str(int(code)) for code in never)
    assert value("SuccessExitStatus") == str(int(ExitCode.INTERRUPTED))
    assert int(value("LimitRTPRIO")) >= PRIORITY
    assert value("LimitMEMLOCK") == "infinity"
    assert value("CapabilityBoundingSet") == value("AmbientCapabilities") == ""
    assert "AF_CAN" in value("RestrictAddressFamilies").split()
    watchdog_ms = float(value("WatchdogSec").removesuffix("ms"))
    assert 10 * TICK_NS * 1e-6 < watchdog_ms <= 500
    keys = {key for _, key, _ in entries(UNIT)}
    assert not keys & {"CPUQuota", "BindsTo", "CPUSchedulingPolicy", "RestrictRealtime"}


def test_unit_does_what_the_page_says_of_it():
    words = shlex.split(value("ExecStart"))
    assert words[words.index("--out") + 1] == f"/var/log/{value('LogsDirectory')}"
    page = " ".join(Path("docs/deployment.md").read_text(encoding="utf-8").split())
    megabytes = int(words[words.index("--keep") + 1])
    assert f"{megabytes // 1000} GB" in page
    # again and again, a second later
    assert (value("StartLimitIntervalSec"), value("RestartSec")) == ("0", "1")
    # the controller alone is asked to end, and ends the others in order; a loop that hangs is not
    assert (value("KillMode"), value("WatchdogSignal")) == ("mixed", "SIGKILL")
    # imports on a slow machine; recordings that are brought to their end
    assert int(value("TimeoutStartSec")) >= 120
    # log and recording are waited for one after the other, then a terminal's last lines
    assert int(value("TimeoutStopSec")) >= 2 * beside.END_S + 10.0 + 5.0
    assert int(value("OOMScoreAdjust")) <= -900
    assert value("OOMPolicy") == "continue"


def test_network_file_has_the_controllers_bit_rate_and_keys_that_networkd_knows():
    network, link = DEPLOY / "80-can0.network", DEPLOY / "80-can0.link"
    rate = value("BitRate", network)
    assert int(rate.removesuffix("K")) * 1000 == ControllerConfig.model_fields["bit_rate"].default
    assert value("RestartSec", network) == "100ms"
    assert int(value("TransmitQueueLength", link)) == 10
    interface = re.search(r"--bus (\w+)", value("ExecStart"))
    assert interface
    assert {value("Name", network), value("OriginalName", link)} == {interface[1]}
    assert f"sys-subsystem-net-devices-{interface[1]}.device" == value("After") == value("Wants")
    if NETWORKD.exists():  # its table of keys stands in the program
        known = NETWORKD.read_bytes()
        for section, key, _ in entries(network):
            assert f"{section}.{key}".encode() in known
        assert b"CAN.BitRat3" not in known


def test_group_of_the_device_is_that_of_the_service():
    rules = (DEPLOY / "90-utank-hil.rules").read_text()
    assert f'GROUP="{value("SupplementaryGroups")}"' in rules
    assert value("SupplementaryGroups") != UNIT.stem  # else DynamicUser could not make its user
    assert 'KERNEL=="cpu_dma_latency"' in rules
    assert 'MODE="0660"' in rules
    assert value("DeviceAllow") == "/dev/cpu_dma_latency rw"


@pytest.mark.parametrize(
    ("wrong", "code"),
    [("law: {kind: gpc", ExitCode.USAGE), ("law: {kind: nothing}", ExitCode.USAGE)],
)
def test_what_the_check_refuses_the_run_refuses_with_the_code_that_is_not_tried_again(
    wrong, code, tmp_path
):
    path = tmp_path / "controller.yaml"
    ship = Path("configs/ships/thesis_first.yaml").resolve()
    path.write_text(f"name: wrong\nvessel: {ship}\n{wrong}\n", encoding="utf-8")
    assert CliRunner().invoke(app, ["check", str(path)]).exit_code != ExitCode.OK
    assert CliRunner().invoke(app, ["run", str(path), "--bus", "nowhere0"]).exit_code == code


def instructions():
    """Instruction and arguments of each line of the container file, continuations joined."""
    text = (DEPLOY / "Containerfile").read_text(encoding="utf-8").replace("\\\n", " ")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return [tuple(line.split(maxsplit=1)) for line in lines]


def test_the_container_file_installs_what_make_wheel_writes():
    written = set(re.findall(r"> (dist/\S+)", Path("Makefile").read_text(encoding="utf-8")))
    copied = set()
    for name, arguments in instructions():
        assert name in {"FROM", "COPY", "RUN", "ENTRYPOINT", "WORKDIR", "CMD"}
        if name in {"ENTRYPOINT", "CMD"}:
            assert isinstance(json.loads(arguments), list)
        if name == "COPY":
            *sources, place = arguments.split()
            assert place.endswith("/")
            copied |= set(sources)
        if name == "RUN":
            used = {f"dist/{Path(word).name}" for word in shlex.split(arguments) if "/" in word}
            assert used <= copied
    assert copied == written | {"dist/utank_hil-*.whl"}


def test_the_images_run_commands_that_there_are_on_the_locked_python():
    stages = [a for name, a in instructions() if name == "FROM"]
    base, first = stages[0].split(" AS ")
    assert [each.split(" AS ")[1] for each in stages] == ["ship", "bench"]
    assert stages[1].startswith(f"{first} ")
    version = re.search(r"--python-version ([\d.]+)", Path("Makefile").read_text("utf-8"))[1]
    assert base.startswith(f"docker.io/library/python:{version}-")
    for name, arguments in instructions():
        if name == "CMD":
            result = CliRunner().invoke(app, [json.loads(arguments)[0], "--help"])
            assert result.exit_code == 0
