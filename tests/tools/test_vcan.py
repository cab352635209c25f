"""``tools/vcan``: the command behaves as it would without it, and has a ``vcan0``.

Run on the host, these boot the user-mode kernel. Run inside one already (the whole suite under
``tools/vcan``), they check the native way, which is what a nested launcher takes.
"""

import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

VCAN = str(Path(__file__).resolve().parents[2] / "tools" / "vcan")
NESTED = "User Mode Linux" in Path("/proc/cpuinfo").read_text()
WAY = "--native" if NESTED else "--uml"
LIMIT_S = 60

ECHO = """
import json, os, sys
stdin = sys.stdin.buffer.read()
with open("here", "w") as file:
    file.write("written inside")
facts = {"argv": sys.argv[1:], "env": os.environ["ODD"], "cwd": os.getcwd(), "uid": os.getuid()}
sys.stderr.buffer.write(json.dumps(facts).encode() + stdin[::-1])
sys.stdout.buffer.write(stdin)
sys.exit(42)
"""

LOOP = """
import time
try:
    print("started", flush=True)
    for _ in range(3000):
        time.sleep(0.01)
except KeyboardInterrupt:
    print("interrupted", flush=True)
    raise SystemExit(3)
"""

SENDER = """
import can, time
with can.Bus("vcan0", interface="socketcan") as bus:
    for number in range(20):
        bus.send(can.Message(arbitration_id=0x08FF1080, data=bytes([number] * 8)))
        answer = bus.recv(10)
        assert answer is not None and answer.arbitration_id == 0x08FF2081, answer
        assert answer.data == bytes([255 - number] * 8), answer
"""

ANSWERER = """
import can
with can.Bus("vcan0", interface="socketcan") as bus:
    print("listening", flush=True)
    for _ in range(20):
        got = bus.recv(10)
        data = bytes(255 - byte for byte in got.data)
        bus.send(can.Message(arbitration_id=0x08FF2081, data=data))
"""

CONVERSATION = """
import subprocess, sys, time
python, sender, answerer = sys.argv[1:]
log = subprocess.Popen(["candump", "-L", "-n", "40", "vcan0"])
time.sleep(0.5)
other = subprocess.Popen([python, "-c", answerer], stdout=subprocess.PIPE)
other.stdout.readline()
subprocess.run([python, "-c", sender], check=True)
sys.exit(other.wait(20) or log.wait(20))
"""

SEND_TO_ONESELF = """
import socket
with socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as bus:
    bus.bind(("vcan0",))
    bus.send(bytes(16))
with socket.create_server(("127.0.0.1", 0)) as server:
    socket.create_connection(server.getsockname()).close()
print("sent")
"""


def run(*arguments, **options):
    return subprocess.run(  # options pass through
        [VCAN, *arguments], capture_output=True, timeout=LIMIT_S, **options
    )


def start_loop():
    command = [VCAN, WAY, sys.executable, "-c", LOOP]
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert process.stdout.readline() == b"started\n"  # while it runs: output is live
    return process


@pytest.fixture
def on_disk():
    """A folder that the emulated kernel sees, wherever temporary ones are: /dev/shm is its own."""
    with tempfile.TemporaryDirectory(dir="/var/tmp") as folder:
        yield Path(folder)


def test_command_runs_as_without_it(on_disk):
    directory = on_disk / "a b"
    directory.mkdir()
    arguments = ["two words", "", "quote ' and \"", "$HOME `id` \\n", "roulis ± 5° ☃", "--uml"]
    odd = "line\nbreak = ü 'x'"
    sent = random.Random(1).randbytes(100_000) + bytes(range(256)) + b"\r\n\x03\x04\x00"
    done = run(
        WAY,
        "--",
        *(sys.executable, "-c", ECHO, *arguments),
        cwd=directory,
        env={**os.environ, "ODD": odd},
        input=sent,
    )
    assert done.stdout == sent
    assert done.stderr.endswith(sent[::-1])
    facts = json.loads(done.stderr[: -len(sent)].splitlines()[-1])
    uid = os.getuid()
    assert facts == {"argv": arguments, "env": odd, "cwd": str(directory), "uid": uid}
    assert done.returncode == 42
    assert (directory / "here").read_text() == "written inside"


def test_both_outputs_to_one_file_keep_their_order():
    script = "for i in 1 2 3 4 5; do echo out $i; echo err $i >&2; done"
    done = subprocess.run(
        [VCAN, WAY, "sh", "-c", script],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        timeout=LIMIT_S,
        check=True,
    )
    expected = b"".join(b"out %d\nerr %d\n" % (i, i) for i in range(1, 6))
    assert done.stdout.endswith(expected)


def test_command_ends_by_sigpipe_when_nobody_reads():
    process = subprocess.Popen([VCAN, WAY, "yes"], stdout=subprocess.PIPE)
    assert process.stdout.read(2) == b"y\n"
    process.stdout.close()
    assert process.wait(LIMIT_S) == -signal.SIGPIPE


def test_sigint_reaches_the_command():
    process = start_loop()
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=LIMIT_S)
    assert output == b"interrupted\n"
    assert process.returncode == 3


def test_sigterm_ends_the_command_and_shows_as_such():
    process = start_loop()
    process.terminate()
    process.communicate(timeout=LIMIT_S)
    assert process.returncode == -signal.SIGTERM


def test_no_kernel_outlives_a_killed_launcher():
    process = start_loop()
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    assert bool(children) == (not NESTED)
    process.kill()
    process.communicate(timeout=LIMIT_S)
    end = time.monotonic() + 10
    while any(Path(f"/proc/{child}").exists() for child in children):
        assert time.monotonic() < end, f"still there: {children}"
        time.sleep(0.05)


@pytest.mark.evidence("/etc/passwd-126")
@pytest.mark.parametrize(("command", "code"), [("no-such-command", 127), ("/etc/passwd", 126)])
def test_command_that_cannot_run_is_told_apart(command, code):
    done = run(WAY, command)
    assert done.returncode == code
    assert command.encode() in done.stderr


@pytest.mark.parametrize("arguments", [(), ("--",), ("--bogus", "true"), ("--uml", "--native")])
def test_wrong_usage_is_refused(arguments):
    done = run(*arguments)
    assert done.returncode == 125
    assert b"usage: tools/vcan" in done.stderr
    assert done.stdout == b""


def test_no_time_limit_holds_real_time_processes_up():
    """One of 10 ms, counted in ticks of 10 ms, held a loop for 50 ms once a second."""
    limit = run(WAY, "cat", "/proc/sys/kernel/sched_rt_runtime_us")
    assert limit.stdout.strip() == b"-1"


@pytest.mark.evidence
def test_two_processes_talk_on_vcan0_and_candump_hears_every_frame():
    done = run(WAY, sys.executable, "-c", CONVERSATION, sys.executable, SENDER, ANSWERER)
    assert done.returncode == 0, done.stderr.decode()
    frames = [line.split()[2] for line in done.stdout.decode().splitlines()]
    expected = []
    for number in range(20):
        expected.append(f"08FF1080#{bytes([number] * 8).hex().upper()}")
        expected.append(f"08FF2081#{bytes([255 - number] * 8).hex().upper()}")
    assert frames == expected


@pytest.mark.evidence("--map-root-user")
@pytest.mark.parametrize("identity", ["--map-root-user", "--map-current-user"])
def test_native_way_makes_a_vcan0_where_there_is_none(identity):
    inside = (VCAN, "--native", sys.executable, "-c", SEND_TO_ONESELF)
    done = run(WAY, "unshare", "--user", identity, "--net", *inside)
    assert done.returncode == 0, done.stderr.decode()
    assert done.stdout == b"sent\n"
