"""Opens MIDI ports of this machine through mido and python-rtmidi (the extra ``midi``)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from controller.base.errors import LinkError
from controller.base.parameters import did_you_mean

_POLL_INTERVAL_S = 0.005
_MAX_MESSAGES = 4096  # per call of receive


def _import_mido() -> Any:
    try:
        import mido  # optional: the extra midi
        import rtmidi  # noqa: F401  the backend that mido uses
    except ImportError as error:
        raise LinkError(
            f"MIDI ports need the packages mido and python-rtmidi: {error}", hint="pip install 'omote[midi]'"
        ) from error
    return mido


def _find_port(names: Sequence[str], wanted: str) -> str:
    """Return the port whose name is, or begins with, ``wanted``. Raises LinkError."""
    for found in (*(name for name in names if name == wanted), *(name for name in names if name.startswith(wanted))):
        return found
    there = ", ".join(names) or "none"
    raise LinkError(f"midi:{wanted}: no such MIDI port{did_you_mean(wanted, names)}", hint=f"there are: {there}")


class MidiReceiver:
    """Receives the messages of a MIDI port as bytes."""

    def __init__(self, name: str) -> None:
        mido = _import_mido()
        self.error, self._name = "", _find_port(mido.get_input_names(), name)
        self._port = mido.open_input(self._name)

    def receive(self, timeout_s: float) -> list[tuple[str, bytes]]:
        """Wait for messages, and return all that are there."""
        end_s = time.monotonic() + timeout_s
        while True:
            pending = zip(range(_MAX_MESSAGES), self._port.iter_pending(), strict=False)  # limits their number
            data = b"".join(bytes(message.bytes()) for _, message in pending)
            if data or time.monotonic() >= end_s:
                return [(self._name, data)] if data else []
            time.sleep(_POLL_INTERVAL_S)

    def close(self) -> None:
        """Give the port back."""
        self._port.close()


class MidiSender:
    """Sends bytes to a MIDI port."""

    def __init__(self, name: str) -> None:
        self._mido = _import_mido()
        self.error, self._name = "", _find_port(self._mido.get_output_names(), name)
        self._port = self._mido.open_output(self._name)

    def send(self, message: bytes) -> bool:
        """Send the messages in some bytes."""
        for each in self._mido.parse_all(message):
            self._port.send(each)
        return True

    def close(self) -> None:
        """Give the port back."""
        self._port.close()
