"""Serves the simulated robot host's end of a pseudo-terminal, which the controller opens like any serial device."""

from __future__ import annotations

import os
import select

from drivers.sim.serving.ports import Link, PtyPort

_WRITE_TIMEOUT_S = 0.2


class HostPort(PtyPort):
    """A pseudo-terminal that waits for bytes, and for room to write; parameters and errors as in the base class."""

    def open(self, link: Link = None) -> None:
        """Make the pseudo-terminal; ``path`` is its own name even if there is a link to it."""
        super().open(link)
        self.path = self.device

    def read(self, timeout_s: float = 0.0) -> bytes:
        """Wait for the first byte and return what has arrived; empty after ``timeout_s``."""
        ready, _, _ = select.select(self.descriptors, [], [], max(0.0, timeout_s))
        return super().read() if ready else b""

    def write(self, data: bytes) -> None:
        """Send bytes; what the other side does not take within 0.2 s is dropped and counted."""
        view = memoryview(data)
        while view:
            try:
                view = view[os.write(self.descriptors[0], view) :]
            except OSError:
                if not select.select([], self.descriptors, [], _WRITE_TIMEOUT_S)[1]:
                    self.dropped += len(view)
                    return

    def __enter__(self) -> HostPort:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
