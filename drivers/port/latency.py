"""The latency timer of USB serial adapters: found in sysfs or by late replies, and the commands that fix it.

An FTDI chip holds short replies back until its timer ends, by default after 16 ms (FTDI AN232B-04). So a bus with one
request per cycle stays below 60 Hz, however fast its wire is.
"""

from __future__ import annotations

from collections import deque
from pathlib import Path
from statistics import quantiles

SLOW_LATENCY_S = 0.0015
"""A timer above this slows a bus down."""
LATE_S = 0.005
"""Replies with a longer delay beyond their time on the wire are held back: host and servo need 1 ms together."""
MAX_DELAYS, MIN_DELAYS = 64, 8
"""Number of delays that are kept, and that are needed to judge."""


class ReplyDelays:
    """How long the newest answers of single servos took beyond their time on the wire, seconds."""

    def __init__(self) -> None:
        self._delays: deque[float] = deque(maxlen=MAX_DELAYS)

    def add(self, delay_s: float) -> None:
        """Keep one."""
        self._delays.append(delay_s)

    def clear(self) -> None:
        """Forget all, as for another adapter."""
        self._delays.clear()

    @property
    def usual_s(self) -> float | None:
        """The lower quartile, for a timer delays every answer and a busy host some; None before there are enough."""
        return quantiles(self._delays, n=4)[0] if len(self._delays) >= MIN_DELAYS else None


def latency_remedies(device: str, serial_number: str = "") -> tuple[str, ...]:
    """Commands that set the timer of a device to 1 ms: for now, the same with setserial, and a permanent udev rule."""
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
    """Describe what slows a port down, and the command that fixes it; both empty where nothing does.

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
