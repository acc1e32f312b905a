"""One cycle of a bus where all is well: every servo's reply through one compiled call, into a state made before.

Between the last byte of the replies and the first byte of the next goals the wire is idle, and after every wait the
processor is cold, so each kind of thing done there costs many times what it costs elsewhere. What can be made while
the wire is busy is made then. Whatever is not as expected is left to ``telemetry``, which looks at every reply.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.base.bus import BusState, Floats
from drivers.dynamixel.frames import GroupRead
from drivers.dynamixel.groups import Question
from drivers.servos.telemetry import sealed


class Sweep:
    """A read of all servos of a bus.

    Parameters
    ----------
    questions : what they are asked, everyone once.
    read : the packet that asks it.
    octets, known : what is known of the servos, see ``drivers.core.kernels.take_replies``.
    axes : of their ``Scale``.
    told : gives error, supply, temperature, hardware error and torque as known, (n,) each, read-only.

    Attributes
    ----------
    state : what the replies brought, once `take` took them; None until then.
    """

    def __init__(
        self,
        questions: Sequence[Question],
        read: GroupRead,
        octets: NDArray[np.uint8],
        known: Floats,
        axes: Floats,
        told: Callable[[], Sequence[NDArray[Any]]],
    ) -> None:
        from drivers.core.kernels import take_replies  # compiled: only who drives servos pays for it

        self._take_replies, self.read = take_replies, read
        self._octets, self._known, self.axes, self._told = octets, known, axes, told
        self._buffer = bytearray(read.size)
        self._bytes = np.frombuffer(self._buffer, np.uint8)
        self._places = np.concatenate([question.group.index for question in questions])
        self._fields = np.concatenate([_fields(question, read.fast) for question in questions])
        self._scales = np.full((3, len(self._places)), np.nan)
        for question in questions:
            group = question.group
            self._scales[:, group.index] = [group.scales[name] for name in ("velocity", "current", "temperature")]
        self.state: BusState | None = None
        self._all, self._none = (sealed(np.full(len(self._places), flag)) for flag in (True, False))

    def prepare(self) -> None:
        """Make the state that `take` fills."""
        self.state = None
        self._out = np.empty((4, len(self._all)))
        position, velocity, current, age = (sealed(row) for row in self._out)
        error, volts, celsius, hardware, torque = self._told()
        self._next = BusState(
            time_s=np.nan,
            position_rad=position,
            velocity_rad_s=velocity,
            current_a=current,
            fresh=self._all,
            age_s=age,
            error=error,
            silent=self._none,
            voltage_v=volts,
            temperature_c=celsius,
            hardware_error=hardware,
            torque=torque,
        )

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
        object.__setattr__(self._next, "time_s", now_s)  # frozen from when it is given away
        self.state = self._next
        return True


def _fields(question: Question, joint: bool) -> NDArray[np.int64]:
    """Registers of each servo, (k, 7, 3); see ``drivers.core.kernels.register``. Data begin behind the error byte, and
    in a joint reply behind the id."""
    # start-up: compiled, and only who drives servos pays for it
    from drivers.core.kernels import FIELDS, SIGN_MAGNITUDE, TWOS_COMPLEMENT, UNSIGNED

    block, fields = question.block, np.zeros((len(FIELDS), 3), np.int64)
    for row, name in enumerate(FIELDS):
        if (item := block.items.get(name)) is None:
            continue
        kind = TWOS_COMPLEMENT if item.signed else UNSIGNED
        if name == "velocity" and question.group.layout.signed_magnitude:
            kind = SIGN_MAGNITUDE
        fields[row] = item.address - block.address + (2 if joint else 1), item.size, kind
    return np.repeat(fields[np.newaxis], len(question.ids), axis=0)
