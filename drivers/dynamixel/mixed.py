"""Bus of Dynamixel servos of both protocols on one wire: two drivers that share a port and take turns.

Servos ignore packets of the other protocol: to Protocol 1.0 a Protocol 2.0 header is ``FF FF``, id 253, length 0.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.base.bus import BusReport, BusState, Floats, ServoInfo, ServoSpec, frozen
from drivers.base.errors import BusError, DriverError, NoReply, PortLost, merge_errors
from drivers.core.wirebus import WireBus
from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.legacy import LegacyBus
from drivers.packets.packet import MAX_ID
from drivers.tables.tables import load_table

ONLY_LEGACY = {"singles", "torque_limit"}
"""Options that only the driver of Protocol 1.0 has."""
ONLY_NEW = {"baud", "margin_s", "fast", "indirect"}
"""Options that only the driver of Protocol 2.0 has, and those of the port, which that driver opens."""


class MixedBus(WireBus):
    """Servos of Protocol 1.0 and 2.0 on one serial port.

    servos : the servos in the order of all arrays; their models decide the protocol.
    options : see :class:`~drivers.dynamixel.bus.DynamixelBus` and :class:`~drivers.dynamixel.legacy.LegacyBus`.
    """

    def __init__(
        self,
        servos: Iterable[ServoSpec],
        *,
        port: str,
        clock: Callable[[], float] = time.monotonic,
        **options: Any,
    ) -> None:
        super().__init__(servos, clock=clock)
        new = [servo for servo in self.servos if load_table(servo.model).protocol == 2]
        old = [servo for servo in self.servos if servo not in new]
        for_new = {key: value for key, value in options.items() if key not in ONLY_LEGACY}
        for_old = {key: value for key, value in options.items() if key not in ONLY_NEW}
        self._new = DynamixelBus(new, port=port, clock=clock, **for_new)
        self._old = LegacyBus(old, port=self._new._port, clock=clock, **for_old)
        self._halves: tuple[DynamixelBus | LegacyBus, ...] = (self._new, self._old)
        self._index = [np.array([self.ids.index(servo) for servo in half.ids]) for half in self._halves]

    # ------------------------------------------------------------------ the port

    @property
    def is_open(self) -> bool:
        return self._new.is_open

    @property
    def path(self) -> str:
        return self._new.path

    def _use_path(self, path: str) -> None:
        self._new._use_path(path)

    def _open_link(self) -> None:
        for half in self._halves:  # both share one port, and each half resets its state
            half.open()

    def _close_link(self) -> None:
        self._new._close_link()

    def _release(self) -> None:
        for half in self._halves:
            half._release()

    # ------------------------------------------------------------------ discovering, starting, stopping

    def discover(self, ids: Sequence[int] | None = None) -> list[ServoInfo]:
        """Servos that answer: each id is pinged in the protocol it is configured for, then in the other."""
        with self._detecting_loss():
            found: dict[int, ServoInfo] = {}
            if ids is None:
                found = {info.id: info for info in self._new.discover()}
                ids = range(MAX_ID + 1)
            for half, chosen in [(half, half.ids) for half in self._halves] + [(half, ids) for half in self._halves]:
                missing = [servo for servo in ids if servo in chosen and servo not in found]
                if missing:
                    found |= {info.id: info for info in half.discover(missing)}
            return [info for _, info in sorted(found.items())]

    def _bring_up(self) -> Floats:
        here = np.zeros(len(self.ids))
        self._old._keep &= not hasattr(self, "simulation")  # a simulated bus ends with its program
        for half, index in zip(self._halves, self._index, strict=True):
            try:
                half._start()
            except BaseException:
                self._unconfirmed = True
                self._undo_half_starts()
                self._unconfirmed = any(half._unconfirmed for half in self._halves)
                raise
            here[index] = half._limits.target
        return here

    def _bring_back(self) -> Floats:
        """Start both halves again, each with the servos that can be started."""
        here = np.full(len(self.ids), np.nan)
        for half, index in zip(self._halves, self._index, strict=True):
            with half._detecting_loss():
                half._begin_driving(half._bring_back())
            here[index] = np.where(half.driven, half._limits.target, np.nan)
            self._reasons |= {int(index[at]): why for at, why in half._reasons.items()}
        return here

    def _join(self, index: int) -> float:
        """Return the position of a servo if its half has started it again, rad; else raise why it is left out."""
        for half, places in zip(self._halves, self._index, strict=True):
            if index in places:
                at = half.ids.index(self.ids[index])
                if half.driven[at]:
                    return float(half._limits.target[at])
        raise self._reasons[index].with_traceback(None)  # a kept traceback would grow with every attempt

    def recover(self, ids: Sequence[int] | None = None) -> None:
        """Start servos again that switched off or were rebooted; see :meth:`drivers.servos.bus.ServoBus.recover`."""
        self._raise_if_stopped()
        failed: dict[int, BusError] = {}
        with self._detecting_loss():
            for half in self._halves:
                chosen = [servo for servo in half.ids if ids is None or servo in ids]
                failed |= half._recover(chosen)
                for index, servo in [(self.ids.index(servo), servo) for servo in chosen]:
                    if servo in failed:
                        self._give_up(index, failed[servo])
                    else:
                        self._drive_again(index, half._limits.target[half.ids.index(servo)])
        if failed:
            raise merge_errors(failed)

    def _switch_off(self) -> None:
        failed = self._stop_halves()
        if not failed:
            return
        unconfirmed = tuple(servo for error in failed for servo in error.servo_ids)
        kind = PortLost if any(isinstance(error, PortLost) for error in failed) else NoReply
        raise kind("; ".join(map(str, failed)), hint=failed[0].hint, port=self.path, servo_ids=unconfirmed) from failed[
            0
        ]

    def _undo_half_starts(self) -> None:
        """Disable the torque that the start of the first half enabled, where the start of the second half failed."""
        for half in self._halves:
            if half._running:
                with suppress(DriverError):  # the first error is reported; stop() tries again
                    half._undo_start()

    def _stop_halves(self) -> list[DriverError]:
        """Disable torque on both halves where it may be on, also if the first half fails; return the errors."""
        failed = []
        for half in self._halves:
            if not half._running and not half._unconfirmed:
                continue
            half._running, half._unconfirmed = False, True
            try:
                with half._detecting_loss():
                    half._switch_off()
                half._unconfirmed = False
            except DriverError as error:
                failed.append(error)
        return failed

    # ------------------------------------------------------------------ every cycle

    def _send(self, angle_rad: Floats) -> Floats:
        sent = np.empty(len(self.ids))
        for half, index in zip(self._halves, self._index, strict=True):
            sent[index] = half.write(np.where(self.driven[index], angle_rad[index], np.nan))
            self._copy_held_back(half, index)
        return sent

    @property
    def _reads_a_turn(self) -> int:
        return max(half._reads_a_turn for half in self._halves)

    def _ask(self) -> BusState:
        states = [half.read() for half in self._halves]
        for half, index in zip(self._halves, self._index, strict=True):
            self._copy_held_back(half, index)
        return BusState(states[-1].time_s, *(self._joined(states, field.name) for field in fields(BusState)[1:]))

    def _copy_held_back(self, half: DynamixelBus | LegacyBus, index: NDArray[np.intp]) -> None:
        """Hold back the servos that a half holds back; drive them again from their positions when the half does.

        index : (k,) index in this bus of each of the half's servos.
        """
        in_half, in_both = half._presence.held_back, self._presence.held_back
        for i in np.flatnonzero(in_half != in_both[index]):
            if in_half[i]:
                self._presence.hold_back(int(index[i]))
            else:
                self._begin_at(int(index[i]), float(half._limits.target[i]))
                self._presence.join(int(index[i]))

    def _joined(self, states: Sequence[BusState], name: str) -> NDArray[Any]:
        parts = [getattr(state, name) for state in states]
        whole = np.empty(len(self.ids), parts[0].dtype)
        for part, index in zip(parts, self._index, strict=True):
            whole[index] = part
        return frozen(whole, whole.dtype)

    def report(self) -> BusReport:
        """Sum the counters of both halves."""
        report = super().report()
        errors = Counter(report.errors)
        for half in self._halves:
            part = half.report()
            part.errors.pop("port_lost", None)  # this bus has counted it
            errors.update(part.errors)
            report.errors_by_servo |= part.errors_by_servo
            report.limits_hit += part.limits_hit
            report.speed_limited += part.speed_limited
            report.eeprom_writes += part.eeprom_writes
            report.silent = tuple(sorted((*report.silent, *part.silent)))
            report.stray = part.stray  # counted by the port, which both share
        report.errors = dict(errors)
        return report
