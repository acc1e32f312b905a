"""Serves WebSocket clients in its own thread.

Every client has one task that receives its messages and one that sends to it. A client that does not read loses
answers, which are counted, and gets fewer states. It delays neither the face nor another client.
"""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections import Counter
from contextlib import suppress
from http import HTTPStatus
from typing import Any

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from controller.base.errors import LinkError
from controller.base.version import package_version
from controller.layers.commands import CommandSink
from controller.links.access import bound_at, given_token, is_own_page, same_token, token_for
from controller.links.kind import LinkContext
from controller.links.net.meter import Meter
from controller.links.websocket.conversation import Conversation
from controller.links.websocket.kind import WebSocketSettings
from controller.links.websocket.messages import MAX_MESSAGE_BYTES, Reply

log = logging.getLogger(__name__)

_MAX_WAITING = 256
"""Number of answers that may wait for a client."""
_MAX_RATE_HZ, _MAX_BURST = 1000.0, 2000.0
"""Messages per second that a client may send in the long run, and messages that it may send at once."""
_START_TIMEOUT_S, _STOP_TIMEOUT_S = 10.0, 3.0


def open_websocket(settings: WebSocketSettings, context: LinkContext) -> WebSocketLink:
    """Listen for clients.

    Raises LinkError: the address cannot be used, or the token cannot be stored.
    """
    token = token_for(f"websocket {settings.address}", settings.where[0], settings.token)
    link = WebSocketLink(settings, context.sink, token)
    context.closers.callback(link.stop)
    link.start()
    return link


class WebSocketLink:
    """A WebSocket server for several clients.

    download_s : longest time for sending an HTTP response.
    """

    download_s = 1.0

    def __init__(self, settings: WebSocketSettings, sink: CommandSink, token: str | None) -> None:
        self._settings, self._sink, self._token = settings, sink, token
        package_version()  # cached now, because later there may be no file descriptor left to read it
        self._start_ns = time.monotonic_ns()
        self._clients: set[_Client] = set()
        self._served = 0
        self._turned_away: Counter[str] = Counter()
        self._accepted = 0
        self._refused: Counter[str] = Counter()
        self._unanswered = 0
        self._meter = Meter()
        self._loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        self._error: Exception | None = None
        self._stopping: asyncio.Event | None = None
        self._port = 0
        self._thread = threading.Thread(target=self._run, name=f"websocket {settings.address}", daemon=True)

    @property
    def port(self) -> int:
        """The port it listens on; if the settings say 0, the free one that the system has chosen."""
        return self._port

    def start(self) -> None:
        """Listen. Raises LinkError: the address cannot be used."""
        self._thread.start()
        if not self._ready.wait(_START_TIMEOUT_S):
            raise LinkError(f"websocket {self._settings.address}: did not start within {_START_TIMEOUT_S:g} s")
        if self._error is not None:
            reason = getattr(self._error, "strerror", None) or self._error
            raise LinkError(
                f"websocket {self._settings.address}: cannot listen: {reason}",
                hint=f"is another program there? look: ss -ltnp 'sport = :{self._settings.where[1]}'",
            ) from self._error

    def stop(self) -> None:
        """Disconnect all clients and stop listening; a second call does nothing."""
        if self._thread.is_alive() and self._stopping is not None:
            self._loop.call_soon_threadsafe(self._stopping.set)
            self._thread.join(_STOP_TIMEOUT_S)

    def report(self) -> dict[str, object]:
        """Return counts of current and past clients, of requests and of clients that were turned away."""
        return {
            "port": bound_at(self._settings.address, self._port or self._settings.where[1]),
            "connected": bool(self._clients),
            "clients": len(self._clients),
            "served": self._served,
            "accepted": self._accepted + sum(client.conversation.accepted for client in list(self._clients)),
            "refused": dict(sum((client.conversation.refused for client in list(self._clients)), self._refused.copy())),
            "unanswered": self._unanswered + sum(client.unanswered for client in list(self._clients)),
            "turned_away": dict(self._turned_away),
            **self._meter.report(time.monotonic()),
            "error": "" if self._clients else "no client",
        }

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        except Exception as error:
            if self._ready.is_set():
                raise  # whoever supervises this link opens it again
            self._error = error
        finally:
            self._ready.set()
            self._loop.close()

    async def _serve(self) -> None:
        self._stopping = asyncio.Event()
        host, port = self._settings.where
        quiet = logging.getLogger(f"{__name__}.library")
        quiet.setLevel(logging.CRITICAL)
        async with serve(
            self._talk, host, port, process_request=self._admit, max_size=MAX_MESSAGE_BYTES, max_queue=64,
            compression=None, logger=quiet, open_timeout=max(_START_TIMEOUT_S, self.download_s),
            close_timeout=self.download_s, server_header=None,
        ) as server:  # fmt: skip
            self._port = _port_of(server)
            self._ready.set()
            await self._stopping.wait()
            await self._leave()

    async def _leave(self) -> None:
        """Finish before the server closes; for subclasses."""

    def _admit(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return None for a client that may connect, else the response that says why not."""
        why = self._refusal(request)
        if why is None:
            return None
        status, code, text = why
        self._turned_away[code] += 1
        return connection.respond(status, text + "\n")

    def _refusal(self, request: Request) -> tuple[HTTPStatus, str, str] | None:
        if len(self._clients) >= self._settings.clients:
            return HTTPStatus.SERVICE_UNAVAILABLE, "full", f"all {self._settings.clients} places are taken"
        if self._token is not None:
            given = given_token(request.path, request.headers.get("Authorization"))
            if not same_token(given, self._token):
                text = "a token is needed: ws://HOST:PORT/?token=TOKEN, or the header Authorization: Bearer TOKEN"
                return HTTPStatus.UNAUTHORIZED, "token", text
            return None
        origin = request.headers.get("Origin")
        if origin is not None and not is_own_page(origin, self._settings.origins):
            text = f"a page of {origin} may not connect; add it to origins of the link in the stage"
            return HTTPStatus.FORBIDDEN, "origin", text
        return None

    async def _talk(self, connection: ServerConnection) -> None:
        client = _Client(connection, self._sink, self._start_ns, self._meter)
        self._clients.add(client)
        self._served += 1
        try:
            await client.talk()
        finally:
            self._clients.discard(client)
            self._accepted += client.conversation.accepted
            self._refused += client.conversation.refused
            self._unanswered += client.unanswered


class _Client:
    """One connected client. meter : of all clients. unanswered : number of answers lost because it did not read."""

    def __init__(self, connection: ServerConnection, sink: CommandSink, start_ns: int, meter: Meter) -> None:
        host, port = connection.remote_address[:2]
        self.conversation = Conversation(sink, f"websocket {host}:{port}", start_ns)
        self.unanswered = 0
        self._connection, self._meter = connection, meter
        self._waiting: asyncio.Queue[Reply | None] = asyncio.Queue(_MAX_WAITING)
        self._budget, self._counted_s, self._warned_s = _MAX_BURST, time.monotonic(), 0.0

    async def talk(self) -> None:
        """Serve the client until it disconnects."""
        sending = asyncio.create_task(self._send())
        try:
            async for text in self._connection:
                self._take(text)
        except ConnectionClosed:
            pass
        finally:
            sending.cancel()
            with suppress(asyncio.CancelledError, ConnectionClosed):
                await sending

    def _take(self, text: str | bytes) -> None:
        if not self._is_within_rate() and not _may_stop(text):
            if time.monotonic() > self._warned_s + 1.0:
                self._warned_s = time.monotonic()
                self._put(self.conversation.refuse_rate())
            return
        self._meter.note(time.monotonic())
        self._put(self.conversation.handle(text, time.monotonic_ns()))

    def _is_within_rate(self) -> bool:
        """Count a message; return whether it is within the rate, by a token bucket."""
        now_s = time.monotonic()
        self._budget = min(self._budget + (now_s - self._counted_s) * _MAX_RATE_HZ, _MAX_BURST) - 1.0
        self._counted_s = now_s
        if self._budget < 0.0:
            self._budget = 0.0
            return False
        return True

    def _put(self, reply: Reply | None) -> None:
        """Queue an answer to be sent; None only wakes the sender, which may have a new subscription to serve."""
        if reply is None and not self._waiting.empty():
            return  # the waiting answers wake it already, and None would use up the place of an answer
        try:
            self._waiting.put_nowait(reply)
        except asyncio.QueueFull:
            self.unanswered += reply is not None

    async def _send(self) -> None:
        while True:
            reply = await self._next()
            for each in (reply, *self.conversation.due(time.monotonic_ns())):
                if each is not None:
                    await self._connection.send(each.model_dump_json())

    async def _next(self) -> Reply | None:
        """Wait for the next answer; return None when a state is due."""
        due_ns = self.conversation.due_ns()
        wait_s = None if due_ns is None else max(0.0, (due_ns - time.monotonic_ns()) * 1e-9)
        try:
            return await asyncio.wait_for(self._waiting.get(), wait_s)
        except TimeoutError:
            return None


def _may_stop(text: str | bytes) -> bool:
    """Whether a message may be a STOP, which is accepted at any rate."""
    return len(text) < 200 and ("stop" in text if isinstance(text, str) else b"stop" in text)


def _port_of(server: Server) -> int:
    sockets: Any = server.sockets
    return int(next(iter(sockets)).getsockname()[1])
