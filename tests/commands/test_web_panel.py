"""The panel's page as a plain HTTP client sees it, on a bus in this process."""

import http.client
import json
import os
import re
import signal
import socket
import statistics
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from ship_of_a_page import Bench, bench

from utank_hil.canbus import AlarmState, Fault, Mode, Station
from utank_hil.commands.panel import Keyboard
from utank_hil.commands.web_panel import server
from utank_hil.commands.web_panel.server import MOST_PAGES

pytestmark = pytest.mark.slow


class Client:
    """A page without a browser: follows the states, answers them, and orders."""

    def __init__(self, url: str) -> None:
        self.url, parts = url, urlsplit(url)
        assert parts.hostname is not None
        self.host = parts.netloc
        self.path = parts.path
        self.address = (parts.hostname, parts.port)
        self.number = 0
        self.state: dict[str, Any] = {}
        self.stream = http.client.HTTPConnection(*self.address, timeout=20)
        self.orders = http.client.HTTPConnection(*self.address, timeout=20)

    def ask(
        self,
        name: str,
        body: bytes | None = None,
        *,
        path: str | None = None,
        headers: Mapping[str, str] = {},
    ) -> tuple[int, bytes]:
        """One request; a body makes it a POST. A header that is empty is left out."""
        method = "GET" if body is None else "POST"
        given = {"Host": self.host} | ({"Origin": f"http://{self.host}"} if body else {}) | headers
        self.orders.putrequest(method, (path or self.path) + name, skip_host=True)
        for key, value in given.items():
            if value:
                self.orders.putheader(key, value)
        if body is not None and "Content-Length" not in given:
            self.orders.putheader("Content-Length", str(len(body)))
        self.orders.endheaders(body)
        answer = self.orders.getresponse()
        self.headers = answer.headers
        content = answer.read()
        if answer.will_close:
            self.orders.close()
        return answer.status, content

    def order(self, action: str | None = None, number: int | None = None) -> tuple[int, bytes]:
        content = {"number": self.number if number is None else number, "action": action}
        return self.ask("order", json.dumps(content).encode())

    def open(self) -> "Client":
        self.stream.request("GET", f"{self.path}states")
        self.lines = self.stream.getresponse()
        assert self.lines.status == 200, self.lines.read()
        return self

    def follow(self) -> dict[str, Any]:
        """The next state, answered."""
        while True:
            name, _, content = self.lines.readline().decode().strip().partition(": ")
            if name == "id":
                self.number = int(content)
            elif name == "data":
                self.state = json.loads(content)
                break
        self.order()
        return self.state

    def until(self, what: str) -> dict[str, Any]:
        """Follow until an expression in the state is true."""
        for _ in range(150):
            if eval(what, {"state": self.follow()}):
                return self.state
        raise AssertionError(f"{what}: {self.state}")

    def close(self) -> None:
        self.stream.close()
        if hasattr(self, "lines"):
            self.lines.close()  # else the response keeps the connection
        self.orders.close()


@pytest.fixture(scope="module")
def running() -> Iterator[tuple[Bench, str]]:
    with bench() as made:
        yield made


@contextmanager
def page(url: str) -> Iterator[Client]:
    client = Client(url).open()
    try:
        yield client
    finally:
        client.close()


@pytest.fixture
def at(running: tuple[Bench, str]) -> Iterator[tuple[Bench, Client]]:
    """A bench in STANDBY with an open page, and nobody else."""
    made, url = running
    made.wait("not node.attended")
    made.ship.mode, made.ship.alarms, made.ship.station = Mode.STANDBY, {}, Station.OPERATOR
    with page(url) as client:
        client.until("state['mode'] == 'STANDBY' and state['in_command']")
        made.wait("node.attended")
        yield made, client


def test_arm_disarm_and_stop(at: tuple[Bench, Client]) -> None:
    made, client = at
    assert client.order("arm") == (204, b"")
    client.until("state['mode'] == 'ACTIVE'")
    client.order("disarm")
    client.until("state['mode'] == 'PASSIVE'")
    client.order("arm")
    client.until("state['mode'] == 'ACTIVE'")
    client.order("stop")
    assert client.until("state['mode'] == 'STANDBY'")["said"]["lines"][-1] == "stop"
    assert made.ship.heard[-1][1].stop


def test_figures_are_of_the_bus_and_none_is_of_what_is_not_heard(at: tuple[Bench, Client]) -> None:
    made, client = at
    figures = client.until("abs(state['figures']['roll_deg']) > 1.0")["figures"]
    scripts = [path.read_text() for path in Path(server.__file__).parent.glob("*.js")]
    assert {name for each in scripts for name in re.findall(r"figures\.(\w+)", each)} <= {*figures}
    assert abs(figures["roll_deg"]) <= 3.45
    assert figures["starboard_m"] == pytest.approx(-figures["port_m"], abs=2e-3)
    assert figures["gm_m"] == pytest.approx(1.62, abs=0.01)
    assert figures["passive_rms_deg"] == pytest.approx(2.41, abs=0.01)
    client.order("arm")
    # The two come by frames of their own, the current a fifth as often: 14 A V per Pa, in kW.
    given, power = (f"state['figures']['{name}']" for name in ("given_kpa", "power_kw"))
    client.until(f"abs({given} or 0) > 5 and 0.7 < {power} / (14 * abs({given})) < 1.3")
    client.order("stop")
    made.ship.mute = True
    try:
        # each grows old by itself, those of the sensors first
        shown = ("roll_deg", "heel_deg", "port_m", "given_kpa", "asked_kpa", "power_kw", "load")
        old = " and ".join(f"state['figures']['{name}'] is None" for name in shown)
        old += " and state['figures']['drive'] is None and state['figures']['high_level'] is None"
        client.until(f"not state['heard'] and {old}")
    finally:
        made.ship.mute = False


def test_an_alarm_is_shown_in_words_and_accepted(at: tuple[Bench, Client]) -> None:
    made, client = at
    made.ship.alarms = {Fault.MOTION_SILENT: AlarmState.ACTIVE_UNACKNOWLEDGED}
    (alarm,) = client.until("state['alarms']")["alarms"]
    assert alarm["code"] == "MOTION_SILENT"
    assert alarm["words"][0] == "No usable measurement comes from the motion sensor."
    assert (alarm["lasts"], alarm["accepted"]) == (True, False)
    client.order("accept")
    client.until("state['alarms'] and state['alarms'][0]['accepted']")


def lose_the_page_that_armed(made: Bench, client: Client) -> int:
    """Arm, close the page, and wait until the panel knows; return when it was closed."""
    client.order("arm")
    client.until("state['mode'] == 'ACTIVE'")
    client.close()
    lost_ns = time.monotonic_ns()
    made.wait("not node.attended")
    return lost_ns


def test_a_lost_page_silences_the_panel_and_one_that_returns_goes_on(
    at: tuple[Bench, Client],
) -> None:
    made, client = at
    lost_ns = lose_the_page_that_armed(made, client)
    assert time.monotonic_ns() - lost_ns < 1.5e9
    time.sleep(0.05)
    before = len(made.ship.frames)
    time.sleep(0.5)
    assert len(made.ship.frames) == before  # neither orders nor a heartbeat
    with page(client.url) as again:
        again.follow()
        made.wait("node.attended")
        again.until("state['mode'] == 'ACTIVE'")
        assert made.ship.heard[-1][1].arm
        again.order("stop")
        again.until("state['mode'] == 'STANDBY'")


def test_a_panel_that_was_lost_while_the_controller_left_active_asks_for_nothing(
    at: tuple[Bench, Client],
) -> None:
    made, client = at
    lose_the_page_that_armed(made, client)
    made.ship.mode = Mode.FAULT
    time.sleep(0.3)
    with page(client.url) as again:
        again.until("state['mode'] == 'FAULT'")
        made.wait("node.attended and not ship.heard[-1][1].arm")
        made.ship.mode = Mode.STANDBY
        again.until("state['mode'] == 'STANDBY'")
        assert not made.ship.heard[-1][1].arm


def test_a_page_that_asks_again_gets_no_state_of_a_panel_that_hangs(
    at: tuple[Bench, Client],
) -> None:
    made, client = at
    made.held.set()
    time.sleep(0.3)
    again = Client(client.url)
    again.stream.timeout = 1.5
    with pytest.raises(TimeoutError):
        again.open().follow()
    again.close()
    made.held.clear()
    client.follow()


def test_stop_is_sent_without_an_open_page(running: tuple[Bench, str]) -> None:
    made, url = running
    made.wait("not node.attended")
    made.ship.mode = Mode.ACTIVE
    time.sleep(0.2)
    client = Client(url)
    assert client.order("arm") == (409, b"late: what this page shows is old")
    assert client.order("stop") == (204, b"")
    made.wait("ship.mode is Mode.STANDBY")
    client.close()


def test_two_pages_both_see_and_either_stops(at: tuple[Bench, Client]) -> None:
    made, client = at
    with page(client.url) as other:
        client.order("arm")
        other.until("state['mode'] == 'ACTIVE' and state['said']['lines'][-1] == 'arm'")
        client.follow()
        other.order("stop")
        other.until("state['mode'] == 'STANDBY'")
        client.until("state['mode'] == 'STANDBY' and state['said']['lines'][-1] == 'stop'")
    for _ in range(20):  # one that closes does not take the other with it
        client.follow()
    assert made.node.attended


def test_no_more_pages_than_leave_a_connection_for_orders(at: tuple[Bench, Client]) -> None:
    _, client = at
    url = f"http://{client.host}{client.path}"
    others = [Client(url).open() for _ in range(MOST_PAGES - 1)]
    refused = Client(url)
    with pytest.raises(AssertionError, match="too many pages"):
        refused.open()
    for other in (refused, *others):
        other.close()


def test_a_page_that_takes_nothing_more_leaves_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "_PATIENCE_S", 1.0)
    monkeypatch.setattr(server, "MOST_PAGES", 1)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with (
        ours,
        theirs,
        socket.socket() as asleep,
        socket.create_server(("127.0.0.1", 0)) as listening,
        server.PageServer(listening, theirs, "token") as served,
    ):
        address = listening.getsockname()
        for target in (served.follow, served.serve_forever):
            threading.Thread(target=target, daemon=True).start()
        asleep.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        asleep.connect(address)
        host = f"{address[0]}:{address[1]}"
        asleep.sendall(f"GET /token/states HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
        assert asleep.recv(15) == b"HTTP/1.1 200 OK"
        for _ in range(100):  # some 1 MB: less than the system keeps for a page that is slow
            ours.send(b" " * 10_000)
            time.sleep(0.1)
            if served.pages.acquire(blocking=False):
                return
        raise AssertionError("the page still has its place")


def test_requests_that_come_in_drops_leave_their_places(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "_PATIENCE_S", 0.8)
    monkeypatch.setattr(server, "MOST_CONNECTIONS", 20)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with (
        ours,
        theirs,
        socket.create_server(("127.0.0.1", 0)) as listening,
        server.PageServer(listening, theirs, "token") as served,
    ):
        address = listening.getsockname()
        host = f"{address[0]}:{address[1]}"
        threading.Thread(target=served.serve_forever, daemon=True).start()
        body = f"POST /token/order HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\n"
        begun = (b"", b"GET / HTTP/1.1\r\n", f"{body}Content-Length: 200\r\n\r\n".encode())
        slow = [socket.create_connection(address, 5) for _ in range(30)]
        for number, each in enumerate(slow):
            each.sendall(begun[number % 3])
        for _ in range(12):  # 2.4 s
            for each in slow:
                with suppress(OSError):  # It is closed.
                    each.sendall(b"x")
            time.sleep(0.2)
        with socket.create_connection(address, 5) as client:
            client.sendall(f"GET /token/ HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
            assert client.recv(15) == b"HTTP/1.1 200 OK"
        for each in slow:
            each.close()
        served.shutdown()


def test_connections_that_the_system_refused_a_thread_keep_no_place(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(server, "MOST_CONNECTIONS", 20)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with (
        ours,
        theirs,
        socket.create_server(("127.0.0.1", 0)) as listening,
        server.PageServer(listening, theirs, "token") as served,
    ):
        address = listening.getsockname()
        threading.Thread(target=served.serve_forever, daemon=True).start()

        def answer() -> bytes:
            with socket.create_connection(address, 5) as client:
                client.sendall(b"GET / HTTP/1.1\r\n\r\n")
                try:
                    return client.recv(12)
                except ConnectionResetError:
                    return b""

        def refused(_: threading.Thread) -> None:
            raise RuntimeError("can't start new thread")

        with monkeypatch.context() as without_room:
            without_room.setattr(threading.Thread, "start", refused)
            assert {answer() for _ in range(25)} == {b""}
        assert answer() == b"HTTP/1.1 403"
        served.shutdown()


def test_a_browser_leaves_out_the_port_of_http() -> None:
    class Listening(socket.socket):
        def getsockname(self) -> tuple[str, int]:
            return "192.0.2.7", 80

    with Listening() as listening, server.PageServer(listening, listening, "token") as served:
        assert {"192.0.2.7", "192.0.2.7:80", "localhost"} <= served.hosts


def test_orders_of_a_station_without_the_command_are_refused_in_words(
    at: tuple[Bench, Client],
) -> None:
    made, client = at
    made.ship.station = Station.OPERATOR_2
    client.until("not state['in_command']")
    client.order("arm")
    client.until("state['said']['lines'][-1] == 'the other station has the command: take'")
    client.order("stop")
    client.until("state['said']['lines'][-1] == 'stop'")


def test_an_order_to_an_old_state_is_refused_but_stop(at: tuple[Bench, Client]) -> None:
    _, client = at
    late = (409, b"late: what this page shows is old")
    for number in (client.number - 50, client.number + 50):
        assert client.order("arm", number) == late
        assert client.order(None, number) == late
        assert client.order("stop", number)[0] == 204


STRANGERS = (
    (404, {"path": "/wrong/"}),
    (404, {"path": "/"}),
    (403, {"headers": {"Host": "ship.example"}}),
    (403, {"headers": {"Host": ""}}),
    (403, {"headers": {"Origin": "http://ship.example"}}),
    (403, {"headers": {"Origin": "null"}}),
    (403, {"headers": {"Origin": ""}}),
    (411, {"headers": {"Transfer-Encoding": "chunked"}}),
    (411, {"headers": {"Content-Length": "-1"}}),
    (413, {"headers": {"Content-Length": "257"}}),
)
NO_ORDERS = (
    b"{}", b'{"number": 1, "action": "sink"}', b"[" * 200, b"\xff", b'{"number":1,"x":2}'
)  # fmt: skip


def test_an_order_of_a_stranger_and_what_is_no_order_are_refused(at: tuple[Bench, Client]) -> None:
    made, client = at
    made.said.clear()
    order = json.dumps({"number": client.number, "action": "stop"}).encode()
    for status, change in STRANGERS:
        assert client.ask("order", order, **change)[0] == status, change
    for body in NO_ORDERS:
        assert client.ask("order", body)[0] == 400, body
    client.follow()
    assert not any("stop" in line for line in made.said)


def test_pages_are_served_with_their_policy_and_orders_only_by_post(
    at: tuple[Bench, Client],
) -> None:
    _, client = at
    for name in ("", "page.css", "page.js", "view.js"):
        status, content = client.ask(name)
        assert status == 200
        assert content
        assert "default-src 'none'; script-src 'self'" in client.headers["Content-Security-Policy"]
        assert "Access-Control-Allow-Origin" not in client.headers
    assert client.ask("", headers={"Host": "ship.example"})[0] == 403
    assert client.ask("", headers={"Origin": "http://ship.example"})[0] == 403
    assert client.ask("order")[0] == 404
    for name in ("server.py", "../web_panel/page.html", "%2e%2e/page.css", "?x"):
        assert client.ask(name)[0] == 404
    assert client.ask("", path=client.path.rstrip("/"))[0] == 404


def test_stop_reaches_the_bus_as_fast_as_from_the_keyboard(at: tuple[Bench, Client]) -> None:
    """Both on one bus in one run: from the key, or the request, to the frame."""
    made, client = at
    reading, writing = os.pipe()
    keyboard = Keyboard(made.node, reading, made.said.append, terminal=False)
    look = made.desk.look
    made.desk.look = lambda now_ns: look(now_ns) or keyboard.look(now_ns)
    taken: dict[str, list[float]] = {"keyboard": [], "page": []}
    try:
        for way in ("keyboard", "page") * 3:
            client.until("state['mode'] == 'STANDBY' and not state['stopping']")
            client.order("arm")
            client.until("state['mode'] == 'ACTIVE'")
            began_ns = time.monotonic_ns()
            if way == "page":
                client.order("stop")
            else:
                os.write(writing, b"stop\n")
            made.wait("ship.heard[-1][1].stop")
            stopped_ns = next(
                at_ns for at_ns, order in made.ship.heard if order.stop and at_ns > began_ns
            )
            taken[way].append((stopped_ns - began_ns) * 1e-6)
    finally:
        made.desk.look = look
        os.close(writing)
        os.close(reading)
    medians = {way: statistics.median(times) for way, times in taken.items()}
    print(medians, {way: max(times) for way, times in taken.items()})
    assert medians["keyboard"] < 50
    assert medians["page"] < 50  # what docs/how-to/panel.md asks of a panel


def test_a_server_that_hangs_or_dies_silences_the_panel() -> None:
    with bench() as (made, url), page(url) as client:
        client.until("state['mode'] == 'STANDBY'")
        made.wait("node.attended")
        pid = next(each for each in children() if each != os.getpid())
        os.kill(pid, signal.SIGSTOP)
        made.wait("not node.attended")
        os.kill(pid, signal.SIGKILL)
        made.wait("desk.ended")


def children() -> list[int]:
    """Processes that serve a page, the newest first."""
    found = []
    for entry in os.listdir("/proc"):
        if entry.isdigit():
            try:
                with open(f"/proc/{entry}/stat") as stat, open(f"/proc/{entry}/cmdline") as words:
                    parent = int(stat.read().rpartition(")")[2].split()[1])
                    if parent == os.getpid() and "spawn_main" in words.read():
                        found.append(int(entry))
            except OSError:
                continue
    return sorted(found, reverse=True)
