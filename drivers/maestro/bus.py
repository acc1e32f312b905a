"""Hobby servos on a Pololu Maestro: all targets in one command, what the board puts out asked for in turn.

The board keeps speed and acceleration itself; what it reports is its own pulse on the way to the target, never the
shaft. On any error it stops all pulses: that is told, and the next target brings them back where they were.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from drivers.base.bus import Floats, ServoSpec
from drivers.base.errors import DriverError, NoReply, ServoRefused
from drivers.boards.ordered_replies import OrderedReplies
from drivers.boards.pulses import PulseBus
from drivers.maestro import protocol as m

log = logging.getLogger(__name__)

MINI, MICRO = "mini", "micro"


class MaestroBus(PulseBus):
    """A Maestro on one port. See :class:`~drivers.boards.bus.BoardBus` for what it shares with other boards.

    Parameters
    ----------
    servos : the servos; ``id`` is the channel.
    board : ``"mini"`` (12, 18 or 24 channels) sets all targets at once, ``"micro"`` (6 channels) cannot.
    device : device number for the Pololu protocol, as on a wire with several boards; None speaks the compact one.
    crc : end every command with a CRC-7; the board must be set to it.
    options : see :class:`~drivers.boards.bus.BoardBus`.

    Raises
    ------
    DriverError : unknown model, or an option that does not fit.
    """

    def __init__(
        self,
        servos: Iterable[ServoSpec],
        *,
        port: str,
        board: str = MINI,
        device: int | None = None,
        crc: bool = False,
        clock: Callable[[], float] = time.monotonic,
        **options: Any,
    ) -> None:
        super().__init__(servos, port=port, clock=clock, **options)
        if board not in (MINI, MICRO):
            raise DriverError(f"there is no Maestro {board!r}", hint=f'use board = "{MINI}" or "{MICRO}"')
        if device is not None and not 0 <= device <= 127:
            raise DriverError(f"device must be 0 to 127, got {device}", hint="12 is what boards leave the factory with")
        self._board, self._device, self._crc = board, device, crc
        self._code = m.Encoder(device, crc)
        probe = self._code.command(m.SCRIPT_STATUS)
        self._talk = OrderedReplies(self._port, probe, lambda data: data in (b"\0", b"\1"), lambda: self._margin_s)

    def far_end(self) -> dict[str, Any]:
        """What a simulated board has to be set to."""
        return {
            "board": self._board,
            "device": 12 if self._device is None else self._device,
            "crc": self._crc,
            "limits_us": [float(self._scale.low_us.min()), float(self._scale.high_us.max())],
        }

    # ------------------------------------------------------------------ looking, starting, stopping

    def _open_link(self) -> None:
        super()._open_link()
        self._talk.reset()
        self._port.write(bytes((m.POLOLU,)))  # by this byte a board on a serial line finds the rate

    def _begin(self) -> Floats:
        present = np.full(len(self.servos), math.nan)
        self._ask_about([], insist=True)  # errors from before are nobody's fault now
        for group in self._groups():
            answer = self._ask_about(group, insist=True)
            if answer is None:
                raise self._no_reply(group)
            present[group] = answer[0]
        self._limit_motion()
        return self._present(present)

    def _bring_up(self) -> Floats:
        start = super()._bring_up()
        self._go(start)  # all at once, as from now on: what the board does not know it says now
        _, errors = self._ask_about([], insist=True) or ((), 0)
        if errors:
            self._switch_off()
            raise ServoRefused(
                f"the Maestro on {self.path} reports {', '.join(m.error_names(errors))}",
                hint='set board = "micro" for one with 6 channels; look at its errors in the Control Center',
                port=self.path,
                servo_ids=self.ids,
            )
        return self._kept_back(start)

    def _kept_back(self, start: Floats) -> Floats:
        """Where the board's own limits let it begin (n,) rad; tells the user where that is not what was asked."""
        present = self._begin()
        for index in np.flatnonzero(np.abs(present - start) * self._scale.us_per_rad > self.SLACK_US):
            servo, here = self.servos[index], self._scale.pulses(present)[index]
            log.warning(
                "channel %d (%s) on %s stays at %.0f us: the board's own limits, or its speed, hold it back; "
                "set them in the Maestro Control Center",
                *(servo.id, servo.name, self.path, here),
            )
        return np.where(np.isnan(present), start, present)

    def _limit_motion(self) -> None:
        """The board's own limits of speed and acceleration, a step above the servo's so that nothing trails."""
        out = b""
        for index, (servo, slope) in enumerate(zip(self.servos, self._scale.us_per_rad, strict=True)):
            speed = min(math.ceil(servo.max_speed_rad_s * slope / m.SPEED_US_S), m.MAX_SPEED)
            push = math.ceil(servo.max_accel_rad_s2 * slope / m.ACCELERATION_US_S2)
            push = push if push <= m.MAX_ACCELERATION else 0  # which is no limit
            out += self._code.word(m.SET_SPEED, servo.id, speed)
            out += self._code.word(m.SET_ACCELERATION, servo.id, push)
            if push:
                self._stop_us[index] = (speed * m.SPEED_US_S) ** 2 / (2.0 * push * m.ACCELERATION_US_S2)
        self._port.write(out)
        self._forgot = False

    def _off(self, index: int) -> None:
        self._port.write(self._code.word(m.SET_TARGET, self.ids[index], 0))

    def _off_confirmed(self, index: int) -> bool:
        answer = self._ask_about([index], insist=True)
        return answer is not None and not answer[0].any()

    # ------------------------------------------------------------------ every cycle

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
        """Commands for the targets; channels in a row share one."""
        goals = {self.ids[i]: int(steps[i]) for i in np.flatnonzero(known)}
        rows = _rows(sorted(goals)) if self._board == MINI else [[channel] for channel in goals]
        for row in rows:
            if len(row) == 1:
                yield self._code.word(m.SET_TARGET, row[0], goals[row[0]])
            else:
                yield self._code.targets(row[0], [goals[channel] for channel in row])

    def _poll(self) -> None:
        """The pulses of some channels in turn, and the board's errors."""
        group = self._turn()
        answer = self._ask_about(group)
        self._heard(answer is not None)
        if answer is None:
            self._report.count("no_reply")
            return
        self._take(group, answer[0].tolist())
        self._tell(answer[1])

    def _doubt(self) -> None:
        self._talk.doubt()

    def _tell(self, errors: int) -> None:
        for name in m.error_names(errors):
            self._report.count("board_" + name.replace(" ", "_"))
            self._say(f"the Maestro on {self.path} reports: {name}; it stopped all pulses")

    # ------------------------------------------------------------------ questions

    def _ask_about(self, group: Sequence[int], insist: bool = False) -> tuple[Floats, int] | None:
        """Pulses (len(group),) us that the board puts out, and its errors since the last time; None: no answer."""
        questions = b"".join(self._code.command(m.GET_POSITION, self.ids[index]) for index in group)
        questions += self._code.command(m.GET_ERRORS)
        data = self._talk.ask(questions, 2 * len(group) + 2, insist=insist)
        if data is None:
            return None
        words = np.frombuffer(data, "<u2")
        return words[:-1] / m.QUARTER, int(words[-1])

    def _no_reply(self, group: Sequence[int]) -> NoReply:
        channels = ", ".join(str(self.ids[index]) for index in group)
        return NoReply(
            f"the Maestro on {self.path} does not say what it puts out on channels {channels}",
            hint="check its power, that it has these channels, its serial mode (USB dual port, or the right baud "
            "rate), its device number and whether it wants a CRC",
            port=self.path,
            servo_ids=tuple(self.ids[index] for index in group),
        )


def _rows(channels: Sequence[int]) -> list[list[int]]:
    """Channels in order, cut where one is left out."""
    rows: list[list[int]] = []
    for channel in channels:
        if rows and rows[-1][-1] == channel - 1:
            rows[-1].append(channel)
        else:
            rows.append([channel])
    return rows
