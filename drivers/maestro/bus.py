"""Driver of hobby servos on a Pololu Maestro: all targets in one command, pulses and errors polled in turn.

The board limits speed and acceleration itself; it reports its own pulse on the way to the target, never the shaft's
position. On an error it stops all pulses; that is logged, and the next targets start them again.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from drivers.base.bus import Floats, ServoSpec
from drivers.base.errors import DriverError, NoReply, ServoRefused
from drivers.boards.ordered_replies import OrderedBus
from drivers.maestro import protocol as m

log = logging.getLogger(__name__)

MINI, MICRO = "mini", "micro"


class MaestroBus(OrderedBus):
    """A Maestro on one port.

    servos : the servos; ``id`` is the channel.
    board : ``"mini"`` (12, 18 or 24 channels) sets all targets at once, ``"micro"`` (6 channels) cannot.
    device : device number for the Pololu protocol, as on a wire with several boards; None: compact protocol.
    crc : end every command with a CRC-7; the board must be set to it.
    options : see :class:`~drivers.boards.bus.BoardBus`.

    Raises DriverError: unknown model, or an option that does not fit.
    """

    SILENT = "the Maestro on {path} does not report its outputs on channels {channels}"
    SILENT_HINT = (
        "check its power, that it has these channels, its serial mode (USB dual port, or the right baud rate), its "
        "device number and whether it wants a CRC"
    )

    def __init__(
        self,
        servos: Iterable[ServoSpec],
        *,
        board: str = MINI,
        device: int | None = None,
        crc: bool = False,
        **options: Any,
    ) -> None:
        super().__init__(servos, **options)
        if board not in (MINI, MICRO):
            raise DriverError(f"there is no Maestro {board!r}", hint=f'use board = "{MINI}" or "{MICRO}"')
        if device is not None and not 0 <= device <= 127:
            raise DriverError(f"device must be 0 to 127, got {device}", hint="12 is what boards leave the factory with")
        self._board, self._device, self._crc = board, device, crc
        self._code = m.Encoder(device, crc)
        self._errors = 0
        self._scale.check_steps(self.servos, m.QUARTER)

    def far_end(self) -> dict[str, Any]:
        return {
            "board": self._board,
            "device": 12 if self._device is None else self._device,
            "crc": self._crc,
            "limits_us": [float(self._scale.low_us.min()), float(self._scale.high_us.max())],
        }

    def _probe(self) -> bytes:
        return self._code.command(m.SCRIPT_STATUS)

    def _answers_probe(self, data: bytes) -> bool:
        return data in (b"\0", b"\1")

    def _open_link(self) -> None:
        super()._open_link()
        self._port.write(bytes((m.POLOLU,)))  # a board on a serial line detects the baud rate from this byte

    def _begin(self) -> Floats:
        self._ask_pulses([], insist=True)  # clears errors from before
        present = super()._begin()
        self._limit_motion()
        return present

    def _bring_up(self) -> Floats:
        start = super()._bring_up()
        try:
            present = self._send_and_check(start)
        except BaseException:
            self._back_out()
            raise
        for index in np.flatnonzero(np.abs(present - start) * self._scale.us_per_rad > self.SLACK_US):
            log.warning(
                "channel %d (%s) on %s stays at %.0f us: the board's own limits, or its speed, hold it back; "
                "set them in the Maestro Control Center",
                *(self.ids[index], self.servos[index].name, self.path, self._scale.pulses(present)[index]),
            )
        return np.where(np.isnan(present), start, present)

    def _send_and_check(self, start: Floats) -> Floats:
        """Send all goals as in every cycle; return what the board puts out then, (n,) rad, NaN for no pulses.

        Raises ServoRefused: the board reports errors, as one that does not know the command. NoReply.
        """
        self._errors = 0
        self._go(start)
        answered = self._ask_pulses([], insist=True) is not None  # reading the errors clears them in the board
        present = self._begin()
        if self._errors:
            raise self._error(
                ServoRefused,
                f"the Maestro on {self.path} reports {', '.join(m.error_names(self._errors))}",
                'set board = "micro" for one with 6 channels; look at its errors in the Control Center',
            )
        if not answered:
            message = f"the Maestro on {self.path} did not answer whether it has errors"
            raise self._error(NoReply, message, "start again; check its cable where it happens often")
        return present

    def _limit_motion(self) -> None:
        """Set the board's limits of speed and acceleration, rounded up so that no servo falls behind its goals."""
        out = b""
        for index, (servo, slope) in enumerate(zip(self.servos, self._scale.us_per_rad, strict=True)):
            speed = min(math.ceil(servo.max_speed_rad_s * slope / m.SPEED_US_S), m.MAX_SPEED)
            acceleration = math.ceil(servo.max_accel_rad_s2 * slope / m.ACCELERATION_US_S2)
            if acceleration > m.MAX_ACCELERATION:
                acceleration = 0  # no limit
            out += self._code.word(m.SET_SPEED, servo.id, speed)
            out += self._code.word(m.SET_ACCELERATION, servo.id, acceleration)
            if acceleration:
                self._stop_us[index] = (speed * m.SPEED_US_S) ** 2 / (2.0 * acceleration * m.ACCELERATION_US_S2)
        self._port.write(out)
        self._forgot = False

    def _off(self, index: int) -> None:
        self._port.write(self._code.word(m.SET_TARGET, self.ids[index], 0))

    def _go(self, angle_rad: Floats) -> Floats:
        if self._forgot:
            self._limit_motion()
        known = np.isfinite(angle_rad)
        steps = self._scale.steps(np.where(known, angle_rad, 0.0), m.QUARTER)
        self._port.write(b"".join(self._targets(steps, known)))
        goals = np.where(known, steps / m.QUARTER, math.nan)
        self._track.go(goals)
        return self._scale.radians(goals)

    def _targets(self, steps: np.ndarray, known: np.ndarray) -> Iterator[bytes]:
        """Encode commands for the targets; a Mini Maestro takes consecutive channels in one command."""
        goals = {self.ids[i]: int(steps[i]) for i in np.flatnonzero(known)}
        if self._board == MICRO:
            yield from (self._code.word(m.SET_TARGET, channel, goal) for channel, goal in goals.items())
            return
        ranked = enumerate(sorted(goals))
        for _, run in groupby(ranked, key=lambda item: item[1] - item[0]):  # the same difference in consecutive ones
            row = [channel for _, channel in run]
            if len(row) == 1:
                yield self._code.word(m.SET_TARGET, row[0], goals[row[0]])
            else:
                yield self._code.targets(row[0], [goals[channel] for channel in row])

    def _poll(self) -> None:
        self._errors = 0
        super()._poll()
        for name in m.error_names(self._errors):
            self._report.count("board_" + name.replace(" ", "_"))
            self._warn(f"the Maestro on {self.path} reports: {name}; it stopped all pulses")

    def _ask_pulses(self, group: Sequence[int], insist: bool = False) -> Floats | None:
        """As in the base class; also reads the board's errors, which clears them in the board, and stores them."""
        requests = b"".join(self._code.command(m.GET_POSITION, self.ids[index]) for index in group)
        data = self._request(requests + self._code.command(m.GET_ERRORS), 2 * len(group) + 2, insist)
        if data is None:
            return None
        words = np.frombuffer(data, "<u2")
        self._errors |= int(words[-1])
        return words[:-1] / m.QUARTER
