"""The latency timer of USB serial adapters: found in sysfs and by late answers, and the commands that mend it.

An FTDI chip holds short answers back until its timer ends, 16 ms as it leaves the factory (FTDI AN232B-04), so that a
bus that asks once a cycle stays below 60 Hz, however fast its wire is.
"""

from __future__ import annotations

from collections import deque
from pathlib import Path
from statistics import quantiles

SLOW_LATENCY_S = 0.0015
"""A timer above this slows a bus down."""
LATE_S = 0.005
"""Answers that come so long after their time on the wire wait for something: host and servo need 1 ms together."""
KEPT, LEAST = 64, 8
"""Answers whose delays are kept, and how many are needed to judge."""


class ReplyDelays:
    """How long the newest answers of single servos took beyond their time on the wire, seconds."""

    def __init__(self) -> None:
        self._delays: deque[float] = deque(maxlen=KEPT)

    def add(self, delay_s: float) -> None:
        """Keep one."""
        self._delays.append(delay_s)

    def clear(self) -> None:
        """Forget all, as for another adapter."""
        self._delays.clear()

    @property
    def usual_s(self) -> float | None:
        """The lower quartile, for a timer delays every answer and a busy host some; None before there are enough."""
        return quantiles(self._delays, n=4)[0] if len(self._delays) >= LEAST else None


def latency_remedies(device: str, serial_number: str = "") -> tuple[str, ...]:
    """Commands that set the timer of a device to 1 ms: for now, the same with setserial, and a udev rule for always."""
    name = Path(device).resolve().name
    return (
        f"echo 1 | sudo tee /sys/bus/usb-serial/devices/{name}/latency_timer",
        f"sudo setserial {device} low_latency",
        f"echo '{latency_rule(serial_number)}' | sudo tee /etc/udev/rules.d/99-usb-latency.rules; "
        "sudo udevadm control --reload; sudo udevadm trigger --subsystem-match=usb-serial",
    )


def latency_rule(serial_number: str = "") -> str:
    """A udev rule that sets the timer to 1 ms, of one adapter or, without a serial number, of all of FTDI's."""
    which = f', ATTRS{{serial}}=="{serial_number}"' if serial_number else ""
    return f'ACTION=="add|change", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio"{which}, ATTR{{latency_timer}}="1"'


def slow_answers(path: str, timer_s: float | None, delay_s: float | None) -> tuple[str, str]:
    """What slows a port down and the command that mends it, each empty where nothing does.

    timer_s : the adapter's latency timer, None where there is none. delay_s : measured, see `ReplyDelays`.
    """
    if timer_s is not None and timer_s > SLOW_LATENCY_S:
        message = f"the adapter of {path} holds answers back for up to {1000 * timer_s:g} ms (its latency timer)"
        return f"{message}: at most {_cap_hz(timer_s)} reads a second", latency_remedies(path)[0]
    if delay_s is None or delay_s < LATE_S:
        return "", ""
    message = f"answers on {path} come {1000 * delay_s:.1f} ms after their time on the wire, as from an adapter with a"
    hint = latency_remedies(path)[1] if "://" not in path else "look at the latency timer of the adapter at its far end"
    return f"{message} latency timer: at most {_cap_hz(delay_s)} reads a second", hint


def _cap_hz(delay_s: float) -> int:
    return int(1.0 / delay_s)
