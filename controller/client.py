"""A client for Python programs: moves a face that ``omote run`` shows, from this machine or another one.

Besides the standard library it needs only the package ``websockets``::

    from controller.client import Face

    with Face() as face:
        face.set(jawOpen=0.4, mouthSmileLeft=0.7)
        face.expression("surprise", 0.8, seconds=2.0)
        print(face.state()["parameters"]["jawOpen"])

:class:`AsyncFace` has the same methods for asyncio. The stage file needs a link of kind ``"websocket"``;
docs/websocket.md has all messages. Both classes raise :class:`FaceError` if the face refuses a request or the
connection is lost.
"""

from __future__ import annotations

import asyncio
import json
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from contextlib import suppress
from typing import Any, Self, TypeVar

try:
    from websockets.asyncio.client import ClientConnection as AsyncConnection
    from websockets.asyncio.client import connect as connect_async
    from websockets.exceptions import ConnectionClosed, InvalidStatus, WebSocketException
    from websockets.sync.client import ClientConnection, connect
except ImportError as error:
    raise ImportError(
        f"controller.client needs the package websockets, 13 or newer: pip install 'omote[web]' ({error})"
    ) from error

URL = "ws://127.0.0.1:8765"
WAIT_S = 5.0
"""Longest wait for a connection or an answer."""
Message = dict[str, Any]


class FaceError(Exception):
    """A request was refused, or the face cannot be reached. ``hint`` : what to do next, or empty."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


class _Requests(ABC):
    """The requests that both clients can send: one waits synchronously for the answers, the other with asyncio.

    A method of :class:`AsyncFace` returns an awaitable of what the method of :class:`Face` returns.
    """

    @abstractmethod
    def _ask(self, kind: str, **fields: Any) -> Any:
        """Send a request and wait for its answer; fields that are None are omitted."""

    def set(self, parameters: Mapping[str, float] | None = None, /, **more: float) -> Any:
        """Hold one or more parameters at values until they are released."""
        return self._ask("set", parameters={**(parameters or {}), **more})

    def release(self, *names: str) -> Any:
        """Release held parameters to the other sources of the face; without names, release all."""
        return self._ask("release", parameters=list(names) or None)

    def expression(self, name: str, intensity: float = 1.0, *, seconds: float | None = None) -> Any:
        """Show a named expression, or a formula such as ``AU6+12``; if ``seconds`` is None, until the next one."""
        return self._ask("expression", name=name, intensity=intensity, duration_s=seconds)

    def emotion(self, valence: float, arousal: float, dominance: float | None = None) -> Any:
        """Show the emotion of a point in the space of valence, arousal and dominance, each -1 to 1.

        If ``dominance`` is None, only valence and arousal choose it.
        """
        return self._ask("emotion", valence=valence, arousal=arousal, dominance=dominance)

    def gaze(self, yaw_deg: float, pitch_deg: float) -> Any:
        """Look in a direction; yaw is positive to the face's own left, pitch upwards."""
        return self._ask("gaze", yaw_deg=yaw_deg, pitch_deg=pitch_deg)

    def gaze_at(self, x_mm: float, y_mm: float, z_mm: float) -> Any:
        """Look at a point, mm from the middle between the eyes: x to the face's own left, y up, z forward."""
        return self._ask("gaze_at", point_mm=[x_mm, y_mm, z_mm])

    def gaze_off(self) -> Any:
        """End a gaze that :meth:`gaze` or :meth:`gaze_at` commanded."""
        return self._ask("gaze_off")

    def neutral(self, seconds: float = 0.5) -> Any:
        """Release everything that was commanded, and return to the neutral face within ``seconds``."""
        return self._ask("neutral", seconds=seconds)

    def life(self, amount: float, manner: str | None = None) -> Any:
        """Set the amount of idle motion, 0 to 1, and its manner: auto, alone, listen or speak; None keeps it."""
        return self._ask("life", amount=amount, manner=manner)

    def show(self, name: str) -> Any:
        """Start a show, which is a script of timed commands, by name."""
        return self._ask("show", name=name)

    def show_action(self, action: str, to: float | str | None = None) -> Any:
        """Control the show that was started last.

        action : ``play``, ``pause``, ``stop`` or ``seek``. to : for ``seek``, the name of a mark or a time (s).
        """
        return self._ask("show", action=action, to=to)

    def stop(self) -> Any:
        """Switch the servos of all robots off (STOP); they stay off until :meth:`start`."""
        return self._ask("stop")

    def start(self) -> Any:
        """Switch the servos on again after :meth:`stop`, whoever sent the STOP."""
        return self._ask("start")

    def state(self) -> Any:
        """Return the present state: ``parameters``, ``measured``, ``stopped_by``, ``status`` and ``time_s``."""
        return self._ask("get")

    def hello(self) -> Any:
        """Return omote's version, the parameters with their ranges, and the names of expressions and layers."""
        return self._ask("hello", version=1)

    def names(self, what: str) -> Any:
        """Return an answer whose ``names`` lists the ``parameters``, ``expressions``, ``layers`` or ``shows``."""
        return self._ask("list", what=what)


class _Dialogue:
    """Numbers and encodes requests, and recognises their answers. No I/O."""

    def __init__(self) -> None:
        self._last = 0

    def request(self, kind: str, fields: Mapping[str, Any]) -> tuple[int, str]:
        """Return the number and the JSON text of a new request."""
        self._last += 1
        present = {key: value for key, value in fields.items() if value is not None}
        return self._last, json.dumps({"type": kind, "id": self._last, **present})

    @staticmethod
    def answer(text: str | bytes, number: int) -> Message | None:
        """Return the answer to request ``number``, or None if ``text`` is another message.

        Raises FaceError: the request was refused.
        """
        message: Message = json.loads(text)
        if message.get("type") == "error" and message.get("id") in (number, None):
            raise FaceError(message["message"], message.get("hint", ""))
        return message if message.get("id") == number else None


class Face(_Requests):
    """A synchronous client, connected when it is created; a context manager that closes the connection.

    Not safe for use by several threads at once.

    url : address of the link. token : the link's token, which other machines need. wait_s : longest wait for the
    connection and for each answer.

    Raises FaceError: nobody listens at ``url``, or the token is wrong.
    """

    def __init__(self, url: str = URL, *, token: str | None = None, wait_s: float = WAIT_S) -> None:
        self._dialogue, self._wait_s = _Dialogue(), wait_s
        headers = {"Authorization": f"Bearer {token}"} if token else None
        self._connection: ClientConnection = _connect(
            url, lambda: connect(url, additional_headers=headers, open_timeout=wait_s, compression=None)
        )

    def _ask(self, kind: str, **fields: Any) -> Message:
        number, text = self._dialogue.request(kind, fields)
        try:
            self._connection.send(text)
            while True:
                found = self._dialogue.answer(self._connection.recv(self._wait_s), number)
                if found is not None:
                    return found
        except (ConnectionClosed, TimeoutError) as error:
            raise _connection_error(error) from error

    def states(self, rate_hz: float = 30.0, *names: str) -> Iterator[Message]:
        """Yield states of the face ``rate_hz`` times a second until the iterator is closed.

        names : the parameters that the states contain; if omitted, all.
        """
        self._ask("subscribe", rate_hz=rate_hz, parameters=list(names) or None)
        wait_s = _wait_for_state(self._wait_s, rate_hz)
        try:
            while True:
                message: Message = json.loads(self._connection.recv(wait_s))
                if message.get("type") == "state" and message.get("id") is None:
                    yield message
        except (ConnectionClosed, TimeoutError) as error:
            raise _connection_error(error) from error
        finally:
            with suppress(ConnectionClosed):
                self._connection.send(json.dumps({"type": "unsubscribe"}))

    def close(self) -> None:
        """Close the connection; what was commanded stays in force."""
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class AsyncFace(_Requests):
    """As :class:`Face`, for asyncio: ``async with AsyncFace() as face: await face.set(jawOpen=0.4)``.

    Await each answer before the next request: one client serves one task, and does not queue requests of several.
    """

    def __init__(self, url: str = URL, *, token: str | None = None, wait_s: float = WAIT_S) -> None:
        self._url, self._token, self._wait_s, self._dialogue = url, token, wait_s, _Dialogue()
        self._connection: AsyncConnection | None = None

    async def __aenter__(self) -> Self:
        headers = {"Authorization": f"Bearer {self._token}"} if self._token else None
        try:
            self._connection = await connect_async(
                self._url, additional_headers=headers, open_timeout=self._wait_s, compression=None
            )
        except (OSError, WebSocketException) as error:
            raise _connect_error(self._url, error) from error
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._require_connection().close()

    async def _ask(self, kind: str, **fields: Any) -> Message:
        number, text = self._dialogue.request(kind, fields)
        try:
            await self._require_connection().send(text)
            while True:
                answer = await asyncio.wait_for(self._require_connection().recv(), self._wait_s)
                found = self._dialogue.answer(answer, number)
                if found is not None:
                    return found
        except (ConnectionClosed, TimeoutError) as error:
            raise _connection_error(error) from error

    async def states(self, rate_hz: float = 30.0, *names: str) -> AsyncIterator[Message]:
        """Yield states of the face ``rate_hz`` times a second until the iterator is closed.

        names : the parameters that the states contain; if omitted, all.
        """
        await self._ask("subscribe", rate_hz=rate_hz, parameters=list(names) or None)
        wait_s = _wait_for_state(self._wait_s, rate_hz)
        try:
            while True:
                message: Message = json.loads(await asyncio.wait_for(self._require_connection().recv(), wait_s))
                if message.get("type") == "state" and message.get("id") is None:
                    yield message
        except (ConnectionClosed, TimeoutError) as error:
            raise _connection_error(error) from error
        finally:
            with suppress(ConnectionClosed):
                await self._require_connection().send(json.dumps({"type": "unsubscribe"}))

    def _require_connection(self) -> AsyncConnection:
        if self._connection is None:
            raise FaceError("not connected", "use it as: async with AsyncFace() as face")
        return self._connection


def _wait_for_state(wait_s: float, rate_hz: float) -> float:
    """Return how long (s) to wait for a state: ``wait_s``, or two periods of a rate so low that they take longer."""
    return max(wait_s, 2.0 / rate_hz) if rate_hz > 0.0 else wait_s


Opened = TypeVar("Opened")


def _connect(url: str, open_connection: Callable[[], Opened]) -> Opened:
    try:
        return open_connection()
    except (OSError, WebSocketException) as error:
        raise _connect_error(url, error) from error


def _connect_error(url: str, error: Exception) -> FaceError:
    if isinstance(error, InvalidStatus):
        why = error.response.body.decode("utf-8", "replace").strip() if error.response.body else str(error)
        return FaceError(f"{url}: {why}")
    return FaceError(f"{url}: no face there: {error}", 'is omote running with [[links]] kind = "websocket"?')


def _connection_error(error: Exception) -> FaceError:
    if isinstance(error, TimeoutError):
        return FaceError("the face did not answer", "is omote still running?")
    return FaceError("the connection was closed", "connect again")
