"""Compiled read of all servos of a bus: one call checks every reply and fills a state that was allocated before.

Between the last byte of the replies and the first byte of the next goals the wire is idle, so whatever can be
allocated while the wire is busy is allocated then. Replies that are not as expected are left to ``telemetry``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.base.bus import BusState, Floats, make_state, read_only
from drivers.dynamixel.frames import GroupRead
from drivers.servos.layout import ReadRequest
from drivers.servos.telemetry import Octets


class CompiledRead:
    """A read of all servos of a bus.

    Parameters
    ----------
    requests, read : the blocks to read, each servo once, and the packet that asks for them.
    octets, known : measurements of the servos, see ``drivers.core.kernels.take_replies``.
    axes : of their ``Scale``.
    slow_values : returns error, supply, temperature, hardware error and torque, (n,) each, read-only.

    Attributes
    ----------
    state : the state after the replies, once `take` took them; None until then.
    """

    def __init__(
        self,
        requests: Sequence[ReadRequest],
        read: GroupRead,
        octets: Octets,
        known: Floats,
        axes: Floats,
        slow_values: Callable[[], Sequence[NDArray[Any]]],
    ) -> None:
        from drivers.core.kernels import take_replies  # imported lazily: loads numba

        self._take_replies, self.read = take_replies, read
        self._octets, self._known, self.axes, self._slow_values = octets, known, axes, slow_values
        self._buffer = bytearray(read.size)
        self._bytes = np.frombuffer(self._buffer, np.uint8)
        self._places = np.concatenate([request.group.index for request in requests])
        self._fields = np.concatenate([_fields(request, read.fast) for request in requests])
        self._scales = np.full((3, len(self._places)), np.nan)
        for group, _, _ in requests:
            self._scales[:, group.index] = [group.scales[name] for name in ("velocity", "current", "temperature")]
        self.state: BusState | None = None
        self._all, self._none = (read_only(np.full(len(self._places), flag)) for flag in (True, False))

    def prepare(self) -> None:
        """Allocate the state that `take` fills; called while the wire is busy."""
        self.state = None
        self._out = np.empty((4, len(self._all)))
        self._next = make_state(np.nan, self._out, self._all, self._none, self._slow_values())

    def take(self, data: bytes, now_s: float) -> bool:
        """Whether the replies are as expected: then `state` holds them; else nothing has changed."""
        read = self.read
        if len(data) != read.size:
            return False
        self._buffer[:] = data
        if not self._take_replies(
            self._bytes, read.fast, read.spans, read.heads, read.states,
            self._places, self._fields, self._scales, self.axes, now_s, self._octets, self._known, self._out,
        ):  # fmt: skip
            return False
        object.__setattr__(self._next, "time_s", now_s)  # frozen once it is handed out
        self.state = self._next
        return True


def _fields(request: ReadRequest, joint: bool) -> NDArray[np.int64]:
    """Registers of each servo, (k, 7, 3); see ``drivers.core.kernels.register``.

    Data begin behind the error byte, and in a joint reply behind the id.
    """
    from drivers.core.kernels import FIELDS, SIGN_MAGNITUDE, TWOS_COMPLEMENT, UNSIGNED  # imported lazily: numba

    block, fields = request.block, np.zeros((len(FIELDS), 3), np.int64)
    for row, name in enumerate(FIELDS):
        if item := block.items.get(name):
            kind = TWOS_COMPLEMENT if item.signed else UNSIGNED if item.sign_bit is None else SIGN_MAGNITUDE
            fields[row] = item.address - block.address + (2 if joint else 1), item.size, kind
    return np.repeat(fields[np.newaxis], len(request.ids), axis=0)
