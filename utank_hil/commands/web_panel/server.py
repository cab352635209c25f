"""The server of a panel's page: a process of its own, so that the loop never waits for a browser.

Each page holds one stream of the panel's states (server-sent events) and answers each of them. The
process tells the panel of answers that are not late, and hands on orders. It ends with the panel.
"""

import io
import multiprocessing
import os
import secrets
import signal
import socket
import threading
import time
from contextlib import suppress
from http import HTTPStatus
from http.client import HTTP_PORT
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any, Final

import msgspec

from utank_hil.commands.web_panel.desk import PRESENT, SHOW_NS
from utank_hil.nodes.panel import Action
from utank_hil.runners.stopping import SIGNALS, signals_waiting

FILES: Final = {"": "page.html", "page.css": "", "page.js": "", "view.js": ""}
"""Files of the page by the end of their address; empty if the file is named so, too."""
_KINDS: Final = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}
MOST_PAGES: Final = 4
"""Pages at a time: a browser opens six connections to a server, and two must be left for orders."""
MOST_CONNECTIONS: Final = 64  #: Four pages with six each, and as many again that are being closed.
MOST_BYTES: Final = 256  #: Length of an order; the longest has some fifty bytes.
LATE: Final = 700_000_000 // SHOW_NS
"""States behind the newest at which what a page shows is old: with the way there less than 1 s."""
_PATIENCE_S: Final = 5.0  #: Time that a whole request may take to come, and a state to leave.
_END_S: Final = 2.0  #: Time for the process to end.
_HEADERS: Final = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "connect-src 'self'; img-src data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class Order(msgspec.Struct, forbid_unknown_fields=True):
    """What a page sends: an answer to the state of a number, with a button or without."""

    number: int
    action: Action | None = None


_DECODE: Final = msgspec.json.Decoder(Order)


class PageServer(ThreadingHTTPServer):
    """Serves the page on a listening socket until the panel's end of `link` is closed."""

    daemon_threads = True

    def __init__(self, listening: socket.socket, link: socket.socket, token: str) -> None:
        super().__init__(listening.getsockname()[:2], _Page, bind_and_activate=False)
        self.socket.close()
        self.socket = listening
        host, port = listening.getsockname()[:2]
        self.hosts = {f"{host}:{port}", f"localhost:{port}"}
        if port == HTTP_PORT:  # Browsers leave it out.
            self.hosts |= {host, "localhost"}
        self.token = token
        self.files = {name: Path(__file__).with_name(file or name) for name, file in FILES.items()}
        self._link = link
        self._changed = threading.Condition()
        self._state = b""
        self.number = 0
        self.pages = threading.BoundedSemaphore(MOST_PAGES)

    def follow(self) -> None:
        """Take the panel's states until it ends."""
        with suppress(OSError):
            while state := self._link.recv(1 << 20):
                with self._changed:
                    self._state, self.number = state, self.number + 1
                    self._changed.notify_all()
        self.shutdown()

    def next_state(self, number: int) -> tuple[int, bytes]:
        """Wait for the state after a number; return its number and JSON, or raise TimeoutError."""
        with self._changed:
            if not self._changed.wait_for(lambda: self.number > number, _PATIENCE_S):
                raise TimeoutError
            return self.number, self._state

    def hand_on(self, order: Order) -> str:
        """Tell the panel of an answer, and of its button; return why not."""
        late = not 0 <= self.number - order.number <= LATE
        if late and order.action is not Action.STOP:
            return "late: what this page shows is old"
        button = PRESENT if order.action is None else order.action.value
        self._link.send(f"{time.monotonic_ns()} {button}".encode())
        return ""

    def verify_request(self, *_: Any) -> bool:
        """Whether there is room for one more connection: each has a thread, beside two."""
        return threading.active_count() <= MOST_CONNECTIONS + 2

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Leave a browser that has gone unmentioned."""


class _InTime(socket.SocketIO):
    """What comes on a connection until a time; TimeoutError after it, however little came."""

    def __init__(self, connection: socket.socket) -> None:
        super().__init__(connection, "r")
        self.connection, self.until_s = connection, 0.0

    def readinto(self, buffer: Any) -> int | None:
        """Read some bytes."""
        self.connection.settimeout(max(self.until_s - time.monotonic(), 1e-3))
        try:
            return super().readinto(buffer)
        finally:
            self.connection.settimeout(_PATIENCE_S)  # For the answer.


class _Page(BaseHTTPRequestHandler):
    """Requests of one connection."""

    server: PageServer
    protocol_version = "HTTP/1.1"
    timeout = _PATIENCE_S
    disable_nagle_algorithm = True  # An order must not wait for an acknowledgement.

    def setup(self) -> None:
        """Read from the connection until a time."""
        super().setup()
        self.rfile.close()
        self._incoming = _InTime(self.connection)
        self.rfile = io.BufferedReader(self._incoming)

    def handle_one_request(self) -> None:
        """Take a request that is whole in time, and answer it."""
        self._incoming.until_s = time.monotonic() + _PATIENCE_S
        super().handle_one_request()

    def do_GET(self) -> None:
        """Answer with a file of the page, or with the stream of states."""
        name = self._admitted()
        if name == "states":
            self._stream()
        elif name in self.server.files:
            file = self.server.files[name]
            self._answer(HTTPStatus.OK, file.read_bytes(), _KINDS[file.suffix])
        elif name is not None:
            self._answer(HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        """Take an order."""
        name = self._admitted(ordering=True)
        if name is None:
            return
        if name != "order":
            self._answer(HTTPStatus.NOT_FOUND, close=True)
            return
        length = self.headers.get("Content-Length", "")
        if "Transfer-Encoding" in self.headers or not length.isdecimal():
            self._answer(HTTPStatus.LENGTH_REQUIRED, close=True)
        elif int(length) > MOST_BYTES:
            self._answer(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, close=True)
        else:
            try:
                order = _DECODE.decode(self.rfile.read(int(length)))
            except (msgspec.DecodeError, RecursionError) as error:
                self._answer(HTTPStatus.BAD_REQUEST, str(error).encode())
                return
            refusal = self.server.hand_on(order)
            self._answer(
                HTTPStatus.CONFLICT if refusal else HTTPStatus.NO_CONTENT, refusal.encode()
            )

    def _admitted(self, *, ordering: bool = False) -> str | None:
        """Return the end of an address with the token; answer and return None without it.

        Another page in the same browser has another origin; a name that was made to point here
        (DNS rebinding) is another host.
        """
        hosts = self.server.hosts
        origin = self.headers.get("Origin", None if ordering else f"http://{self._host}")
        _, token, name = [*self.path.split("/", 2), "?", "?"][:3]
        if self._host not in hosts or origin != f"http://{self._host}":
            self._answer(HTTPStatus.FORBIDDEN, b"another host or origin", close=True)
        elif not secrets.compare_digest(token.encode(), self.server.token.encode()):
            text = b"open the address that the panel printed at its start"
            self._answer(HTTPStatus.NOT_FOUND, text, close=True)
        else:
            return name
        return None

    @property
    def _host(self) -> str:
        return str(self.headers.get("Host", ""))

    def _stream(self) -> None:
        if not self.server.pages.acquire(blocking=False):
            self._answer(HTTPStatus.SERVICE_UNAVAILABLE, b"too many pages are open")
            return
        try:
            # A page whose network or machine has gone must not keep its place for minutes.
            patience_ms = round(1e3 * _PATIENCE_S)
            self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, patience_ms)
            self._head(HTTPStatus.OK, "text/event-stream", None)
            self.close_connection = True
            self.wfile.write(b"retry: 300\n\n")
            number = self.server.number  # A page that asks again must not take an old one as new.
            while True:
                number, state = self.server.next_state(number)
                self.wfile.write(b"id: %d\ndata: %s\n\n" % (number, state))
        except OSError:  # The page is closed, or takes no more.
            self.close_connection = True
        finally:
            self.server.pages.release()

    def _answer(
        self,
        status: HTTPStatus,
        content: bytes = b"",
        kind: str = "text/plain",
        *,
        close: bool = False,
    ) -> None:
        self.close_connection = self.close_connection or close
        self._head(status, kind, len(content))
        self.wfile.write(content)

    def _head(self, status: HTTPStatus, kind: str, length: int | None) -> None:
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        if length is not None and status is not HTTPStatus.NO_CONTENT:
            self.send_header("Content-Length", str(length))
        if self.close_connection:
            self.send_header("Connection", "close")
        for name, value in _HEADERS.items():
            self.send_header(name, value)
        self.end_headers()

    def version_string(self) -> str:
        """Name no version."""
        return "utank-hil"

    def log_message(self, format: str, *arguments: object) -> None:
        """Log nothing: the panel prints the orders."""


def serve(listening: socket.socket, link: socket.socket, token: str) -> None:
    """Serve until the panel ends, as main function of the process."""
    os.setsid()  # The end of the panel ends it, not Ctrl-C or a closed terminal.
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    with PageServer(listening, link, token) as server:
        threading.Thread(target=server.follow, daemon=True).start()
        server.serve_forever(poll_interval=0.1)


class ServerProcess:
    """A server's process (port 0 takes a free one) and the link to it; OSError without address."""

    def __init__(self, host: str, port: int) -> None:
        with socket.create_server((host, port)) as listening:
            self.link, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            token = secrets.token_urlsafe(16)
            self.url = f"http://{host}:{listening.getsockname()[1]}/{token}/"
            context = multiprocessing.get_context("spawn")
            with theirs:
                self._process: SpawnProcess = context.Process(
                    target=serve, args=(listening, theirs, token), daemon=True
                )
                with signals_waiting():
                    self._process.start()

    def close(self) -> None:
        """End the process."""
        self.link.close()
        self._process.join(_END_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
