"""Serves the line protocol to several clients over TCP, in its own thread.

Each client has its own session, as if it were alone on a serial port. A client that does not read loses lines, which
are counted; it delays neither the face nor another client. If other machines can reach the address, a client must send
``AUTH token`` before anything else. HTTP requests, which a web page can make a browser send, are rejected.
"""

from __future__ import annotations

import logging
import selectors
import socket
import threading
import time
from collections import Counter

from controller.layers.commands import CommandSink
from controller.links.access import WebRequests, bound_at
from controller.links.line.kind import LineSettings
from controller.links.line.protocol import Code, LineError, format_error
from controller.links.line.session import LineSession
from controller.links.line.talk import Talk
from controller.links.net.address import Address
from controller.links.net.meter import Meter
from controller.links.net.receivers import bind_socket

log = logging.getLogger(__name__)

_WAIT_S = 0.05
_MAX_READ_BYTES, _TURN_S = 4096, 0.005
"""Bytes of one client that are processed, and time spent on them, before the next client has its turn."""
_REST_FACTOR, _MAX_REST_S = 3.0, 0.02
"""Pause after each pass, in multiples of its time, and its limit, so that a flood costs about a quarter of a core."""
_AUTH_TIMEOUT_S, _MAX_WRONG_TOKENS = 10.0, 3
"""How long a client may take to send its token, and how many wrong ones it may send."""


class Client:
    """One connected client. gone : why it must be disconnected; empty while it may stay."""

    def __init__(self, call: socket.socket, talk: Talk) -> None:
        self.call, self.talk = call, talk
        self.since_s = time.monotonic()
        self.gone = ""
        self._web = WebRequests()

    def read(self) -> bytes:
        """Return what has arrived; sets ``gone`` if the client has left or is a browser."""
        try:
            data = self.call.recv(_MAX_READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self.gone = "left"
        elif self._web.begins(data):
            self.gone = "browser"
        return b"" if self.gone else data

    def put(self, data: bytes) -> int:
        """Send what there is room for, and return the number of bytes; sets ``gone`` if the client has left."""
        try:
            return self.call.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self.gone = self.gone or "left"
            return 0

    def check(self, now_s: float) -> None:
        """Set ``gone`` if the client has not sent its token in time, or too many wrong ones."""
        session = self.talk.session
        if session.locked and (now_s - self.since_s > _AUTH_TIMEOUT_S or session.wrong_tokens >= _MAX_WRONG_TOKENS):
            self.gone = self.gone or "token"


class LineServer:
    """A TCP server for several clients.

    Raises LinkError: the address cannot be used.
    """

    def __init__(self, settings: LineSettings, sink: CommandSink, token: str | None = None) -> None:
        self._settings, self._sink, self._token = settings, sink, token
        self._clients: list[Client] = []
        self._served, self._turned_away, self._past = 0, Counter[str](), Counter[str]()
        self._refused: Counter[int] = Counter()
        self._meter, self._last_fault = Meter(), ""
        self._stopping = threading.Event()
        self._socket = bind_socket(Address("tcp", *settings.where), socket.SOCK_STREAM)
        self._socket.listen()
        self.port = bound_at(settings.address, self._socket.getsockname()[1])
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._socket, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._run, name=f"line {self.port}", daemon=True)

    def start(self) -> LineServer:
        """Start serving."""
        self._thread.start()
        return self

    def stop(self) -> None:
        """Disconnect all clients and stop listening."""
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join()
        for client in self._clients:
            client.call.close()
        self._selector.close()
        self._socket.close()

    def report(self) -> dict[str, object]:
        """Return counts of current and past clients, of lines and bytes, and of clients that were turned away."""
        clients = list(self._clients)
        counts = sum((_counts(client.talk) for client in clients), self._past.copy())
        refused = sum((client.talk.session.refused for client in clients), self._refused.copy())
        keys = ("accepted", "unanswered", "bytes_in", "bytes_out", "streamed", "dropped", "faults")
        return {
            "port": self.port,
            "connected": bool(clients),
            "clients": len(clients),
            "served": self._served,
            "refused": {str(int(code)): count for code, count in sorted(refused.items())},
            "turned_away": dict(self._turned_away),
            **{key: counts[key] for key in keys},
            "last_fault": self._last_fault,
            **self._meter.report(time.monotonic()),
            "error": "" if clients else "no client",
        }

    def _run(self) -> None:
        while not self._stopping.is_set():
            ready = self._selector.select(self._wait_s())
            begin_s = time.monotonic()
            if any(key.fileobj is self._socket for key, _ in ready):
                self._accept()
            self._serve([key.data for key, _ in ready if key.data is not None])
            self._stopping.wait(min(_REST_FACTOR * (time.monotonic() - begin_s), _MAX_REST_S))

    def _wait_s(self) -> float:
        return min((client.talk.wait_s(_WAIT_S) for client in self._clients), default=_WAIT_S)

    def _serve(self, ready: list[Client]) -> None:
        """Act on what has arrived, beginning with clients that send a STOP, and stream to all clients."""
        arrived = {client: client.read() for client in ready if not client.talk.busy}
        for client in sorted(self._clients, key=lambda each: b"STOP" not in arrived.get(each, b"").upper()):
            data, before = arrived.get(client, b""), client.talk.session.accepted
            self._talk(client, data)
            taken = client.talk.session.accepted - before
            if taken:
                self._meter.note(time.monotonic(), skipped=taken - 1)
            client.check(time.monotonic())
        for client in [client for client in self._clients if client.gone]:
            self._remove(client)

    def _talk(self, client: Client, data: bytes) -> None:
        session = client.talk.session
        try:
            client.talk.serve(data, client.put, _TURN_S)
        except Exception as error:  # noqa: BLE001  nothing that arrives may end the link
            session.fault(error, "the link continues with the next line")
            client.talk.lose()
        self._last_fault = session.last_fault or self._last_fault

    def _accept(self) -> None:
        try:
            call, (host, port, *_) = self._socket.accept()
        except OSError as error:  # too many open files, or the client has gone again
            log.debug("line %s: %s", self.port, error)
            return
        call.setblocking(False)
        if len(self._clients) >= self._settings.clients:
            self._refuse_full(call)
            return
        call.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        call.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        session = LineSession(
            self._sink, time.monotonic_ns(), name=f"line {host}:{port}", checksum=self._settings.checksum,
            token=self._token,
        )  # fmt: skip
        client = Client(call, Talk(session))
        self._clients.append(client)
        self._served += 1
        self._selector.register(call, selectors.EVENT_READ, client)

    def _refuse_full(self, call: socket.socket) -> None:
        self._turned_away["full"] += 1
        with call:
            try:
                call.send(format_error(LineError(Code.BUSY, f"all {self._settings.clients} places are taken")))
            except OSError as error:
                log.debug("line %s: %s", self.port, error)

    def _remove(self, client: Client) -> None:
        """Disconnect a client and keep its counts."""
        if client.gone != "left":
            self._turned_away[client.gone] += 1
        client.talk.lose()
        self._past += _counts(client.talk)
        self._refused += client.talk.session.refused
        self._clients.remove(client)
        self._selector.unregister(client.call)
        client.call.close()


def _counts(talk: Talk) -> Counter[str]:
    session = talk.session
    return Counter(talk.counts) + Counter(
        accepted=session.accepted, unanswered=session.unanswered, faults=session.faults
    )
