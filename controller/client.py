"""A client for programs in Python: moves a face that ``omote run`` shows, from this machine or another one.

It needs the package ``websockets`` and nothing else of omote's::

    from controller.client import Face

    with Face() as face:
        face.set(jawOpen=0.4, mouthSmileLeft=0.7)
        face.expression("surprise", 0.8, seconds=2.0)
        print(face.state()["parameters"]["jawOpen"])

:class:`AsyncFace` has the same methods for asyncio. The stage needs a link of kind ``"websocket"``; docs/websocket.md
has all messages. Both classes raise :class:`FaceError` where the face refuses a request or is gone.
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
Message = dict[str, Any]


class FaceError(Exception):
    """The face refused a request, or cannot be reached. ``hint`` : what to do next, or empty."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


class _Requests(ABC):
    """The messages of every request; one class sends them at once, the other with asyncio.

    A method of :class:`AsyncFace` gives an awaitable where that of :class:`Face` gives its result.
    """

    @abstractmethod
    def _ask(self, kind: str, **fields: Any) -> Any:
        """Send a request, and wait for its answer; fields that are None are left out."""

    def set(self, parameters: Mapping[str, float] | None = None, /, **more: float) -> Any:
        """Hold parameters at values, until they are released."""
        return self._ask("set", parameters={**(parameters or {}), **more})

    def release(self, *names: str) -> Any:
        """Give held parameters back; all without names."""
        return self._ask("release", parameters=list(names) or None)

    def expression(self, name: str, intensity: float = 1.0, *, seconds: float | None = None) -> Any:
        """Show a named expression, or a formula such as ``AU6+12``; without ``seconds`` until the next one."""
        return self._ask("expression", name=name, intensity=intensity, duration_s=seconds)

    def emotion(self, valence: float, arousal: float, dominance: float | None = None) -> Any:
        """Show a mood: numbers from -1 to 1."""
        return self._ask("emotion", valence=valence, arousal=arousal, dominance=dominance)

    def gaze(self, yaw_deg: float, pitch_deg: float) -> Any:
        """Look in a direction; yaw is positive to the face's own left, pitch upwards."""
        return self._ask("gaze", yaw_deg=yaw_deg, pitch_deg=pitch_deg)

    def gaze_at(self, x_mm: float, y_mm: float, z_mm: float) -> Any:
        """Look at a point, mm from the middle between the eyes."""
        return self._ask("gaze_at", point_mm=[x_mm, y_mm, z_mm])

    def gaze_off(self) -> Any:
        """Stop looking at anything."""
        return self._ask("gaze_off")

    def neutral(self, seconds: float = 0.5) -> Any:
        """Release everything that was commanded and return to neutral."""
        return self._ask("neutral", seconds=seconds)

    def life(self, amount: float, manner: str | None = None) -> Any:
        """Set the amount of idle motion 0..1, and the manner: auto, alone, listen or speak."""
        return self._ask("life", amount=amount, manner=manner)

    def show(self, name: str) -> Any:
        """Play a script by name."""
        return self._ask("show", name=name)

    def show_action(self, action: str, to: float | str | None = None) -> Any:
        """``play``, ``pause``, ``stop`` or ``seek`` the show that was started last; ``to`` a mark or a time (s)."""
        return self._ask("show", action=action, to=to)

    def stop(self) -> Any:
        """Switch the servos of all robots off, until :meth:`start`."""
        return self._ask("stop")

    def start(self) -> Any:
        """Let the servos move again."""
        return self._ask("start")

    def state(self) -> Any:
        """The face now: ``parameters``, ``measured``, ``stopped_by``, ``status``, ``time_s``."""
        return self._ask("get")

    def hello(self) -> Any:
        """Version, parameters with their ranges, expressions and layers."""
        return self._ask("hello", version=1)

    def names(self, what: str) -> Any:
        """An answer whose ``names`` are those of ``parameters``, ``expressions``, ``layers`` or ``shows``."""
        return self._ask("list", what=what)


class _Dialogue:
    """Numbers requests, and sorts what arrives into answers and states. No I/O."""

    def __init__(self) -> None:
        self._last = 0

    def request(self, kind: str, fields: Mapping[str, Any]) -> tuple[int, str]:
        """A request's number and text."""
        self._last += 1
        given = {key: value for key, value in fields.items() if value is not None}
        return self._last, json.dumps({"type": kind, "id": self._last, **given})

    @staticmethod
    def answer(text: str | bytes, number: int) -> Message | None:
        """The answer to a request; None for another message. Raises FaceError: it was refused."""
        message: Message = json.loads(text)
        if message.get("type") == "error" and message.get("id") in (number, None):
            raise FaceError(message["message"], message.get("hint", ""))
        return message if message.get("id") == number else None


class Face(_Requests):
    """A face that is reached at once; a context that closes the connection at its end. Not for several threads.

    url : where the link listens. token : what it needs where it is open to other machines.

    Raises FaceError: nobody listens there, or the token is wrong.
    """

    def __init__(self, url: str = URL, *, token: str | None = None, wait_s: float = WAIT_S) -> None:
        self._dialogue, self._wait_s = _Dialogue(), wait_s
        headers = {"Authorization": f"Bearer {token}"} if token else None
        self._connection: ClientConnection = _reached(
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
            raise _gone(error) from error

    def states(self, rate_hz: float = 30.0, *names: str) -> Iterator[Message]:
        """The face at a rate, for as long as it is asked for; of all parameters without names."""
        self._ask("subscribe", rate_hz=rate_hz, parameters=list(names) or None)
        wait_s = _wait_for_state(self._wait_s, rate_hz)
        try:
            while True:
                message: Message = json.loads(self._connection.recv(wait_s))
                if message.get("type") == "state" and message.get("id") is None:
                    yield message
        except (ConnectionClosed, TimeoutError) as error:
            raise _gone(error) from error
        finally:
            with suppress(ConnectionClosed):
                self._connection.send(json.dumps({"type": "unsubscribe"}))

    def close(self) -> None:
        """End the connection; the face keeps what was commanded."""
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class AsyncFace(_Requests):
    """As :class:`Face`, for asyncio: ``async with AsyncFace() as face: await face.set(jawOpen=0.4)``.

    Requests of one client are sent one after the other; use a client for each task.
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
            raise _not_reached(self._url, error) from error
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._open.close()

    async def _ask(self, kind: str, **fields: Any) -> Message:
        number, text = self._dialogue.request(kind, fields)
        try:
            await self._open.send(text)
            while True:
                answer = await asyncio.wait_for(self._open.recv(), self._wait_s)
                found = self._dialogue.answer(answer, number)
                if found is not None:
                    return found
        except (ConnectionClosed, TimeoutError) as error:
            raise _gone(error) from error

    async def states(self, rate_hz: float = 30.0, *names: str) -> AsyncIterator[Message]:
        """The face at a rate, for as long as it is asked for; of all parameters without names."""
        await self._ask("subscribe", rate_hz=rate_hz, parameters=list(names) or None)
        wait_s = _wait_for_state(self._wait_s, rate_hz)
        try:
            while True:
                message: Message = json.loads(await asyncio.wait_for(self._open.recv(), wait_s))
                if message.get("type") == "state" and message.get("id") is None:
                    yield message
        except (ConnectionClosed, TimeoutError) as error:
            raise _gone(error) from error
        finally:
            with suppress(ConnectionClosed):
                await self._open.send(json.dumps({"type": "unsubscribe"}))

    @property
    def _open(self) -> AsyncConnection:
        if self._connection is None:
            raise FaceError("not connected", "use it as: async with AsyncFace() as face")
        return self._connection


def _wait_for_state(wait_s: float, rate_hz: float) -> float:
    """How long a state may take at a rate, which may be lower than one in the time of an answer."""
    return max(wait_s, 2.0 / rate_hz) if rate_hz > 0.0 else wait_s


Opened = TypeVar("Opened")


def _reached(url: str, call: Callable[[], Opened]) -> Opened:
    try:
        return call()
    except (OSError, WebSocketException) as error:
        raise _not_reached(url, error) from error


def _not_reached(url: str, error: Exception) -> FaceError:
    if isinstance(error, InvalidStatus):
        said = error.response.body.decode("utf-8", "replace").strip() if error.response.body else str(error)
        return FaceError(f"{url}: {said}")
    return FaceError(f"{url}: no face there: {error}", 'is omote running with [[links]] kind = "websocket"?')


def _gone(error: Exception) -> FaceError:
    if isinstance(error, TimeoutError):
        return FaceError("the face did not answer", "is omote still running?")
    return FaceError("the connection was closed", "connect again")
