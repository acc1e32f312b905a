"""Listing of serial ports, with permissions, latency timer, and the command that fixes a problem with each."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from serial.tools import list_ports as _pyserial

from drivers.port.latency import SLOW_LATENCY_S, latency_remedies
from drivers.port.serialport import latency_s


@dataclass(frozen=True, slots=True)
class PortRecord:
    """One serial device.

    device : path, for example ``/dev/ttyUSB0``.
    by_id : path that stays the same after a replug; None where there is none. Use it in configurations.
    vid_pid : USB vendor and product as ``"0403:6014"``; empty when it is not USB.
    serial_number, description : as the device reports, may be empty.
    usable : this user may read and write it.
    latency_s : the adapter's latency timer in seconds; None where there is none.
    hint : the command that fixes a problem; empty if there is none.
    lasting_hint : the command that fixes it permanently, if that is another one; else empty.
    """

    device: str
    by_id: str | None
    vid_pid: str
    serial_number: str
    description: str
    usable: bool
    latency_s: float | None
    hint: str
    lasting_hint: str = ""

    @property
    def path(self) -> str:
        """The path to write into a configuration."""
        return self.by_id or self.device


def list_ports(
    *,
    dev_root: str | os.PathLike[str] = "/dev",
    sys_root: str | os.PathLike[str] = "/sys",
    comports: Callable[[], Iterable[Any]] = _pyserial.comports,
) -> list[PortRecord]:
    """Serial devices of this machine, sorted by path; opens none of them.

    dev_root, sys_root : folders of devices and of their settings; changed by tests.
    comports : gives pyserial's port records.
    """
    by_id = {link.resolve(): str(link) for link in sorted(Path(dev_root).glob("serial/by-id/*"))}
    return [_record(port, by_id, sys_root) for port in sorted(comports(), key=lambda port: port.device)]


def _record(port: Any, by_id: dict[Path, str], sys_root: str | os.PathLike[str]) -> PortRecord:
    usable = os.access(port.device, os.R_OK | os.W_OK)
    latency = latency_s(port.device, sys_root)
    return PortRecord(
        device=port.device,
        by_id=by_id.get(Path(port.device).resolve()),
        vid_pid="" if port.vid is None else f"{port.vid:04x}:{port.pid:04x}",
        serial_number=port.serial_number or "",
        description="" if port.description in (None, "n/a") else port.description,
        usable=usable,
        latency_s=latency,
        hint=_hint(port.device, usable, latency),
        lasting_hint=latency_remedies(port.device, port.serial_number or "")[2] if _is_slow(latency) else "",
    )


def _hint(device: str, usable: bool, latency: float | None) -> str:
    if not usable:
        return f"sudo usermod -a -G {_group(device)} $USER, then log out and in again"
    if _is_slow(latency):
        return latency_remedies(device)[0]
    return ""


def _is_slow(latency: float | None) -> bool:
    return latency is not None and latency > SLOW_LATENCY_S


def _group(device: str) -> str:
    """Group that owns a device; dialout where that is unknown or root."""
    try:
        group = Path(device).group()
    except (OSError, KeyError, NotImplementedError):
        return "dialout"
    return "dialout" if group == "root" else group
