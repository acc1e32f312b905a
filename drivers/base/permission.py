"""Forbids a process to open ports, so that a mistake in a dry run or a check fails instead of moving servos."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from drivers.base.errors import PortError

_reasons: list[str] = []


@contextmanager
def ports_forbidden(reason: str) -> Iterator[None]:
    """In this context, no thread of this process can open a port or start a process that could.

    `reason` begins the error's message, as in "a dry run".
    """
    _reasons.append(reason)
    try:
        yield
    finally:
        _reasons.remove(reason)


def check_ports_allowed(action: str) -> None:
    """Raise PortError where ports are forbidden; `action` is what was about to happen, as "open port /dev/ttyUSB0"."""
    if _reasons:
        hint = "this is a fault in omote, please report it; nothing was moved"
        raise PortError(f"{_reasons[-1]} does not {action}", hint=hint)
