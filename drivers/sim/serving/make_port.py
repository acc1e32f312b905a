"""Makes the port that a link asks for: each kind by the scheme of its URL, a pseudo-terminal for a path."""

from __future__ import annotations

import os

from drivers.sim.serving.ports import Link, MemoryPort, PtyPort, ServedPort, TcpPort


def make_port(link: Link) -> ServedPort:
    """The port that a link asks for. Raises PortError: it cannot be made."""
    text = "" if link is None else os.fspath(link)
    if text.startswith("socket://"):
        return TcpPort(text)
    if text.startswith("memory://"):
        return MemoryPort(text)
    if text.startswith("rfc2217://"):
        from drivers.sim.serving.rfc2217port import Rfc2217Port  # imported lazily: rarely used

        return Rfc2217Port(text)
    return PtyPort(link)
