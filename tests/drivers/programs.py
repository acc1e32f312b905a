"""Programs that drive a bus and are ended in every way. They are forked from a process that has imported all once."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

import numpy as np

from drivers import open_bus
from drivers.base.bus import ServoSpec
from drivers.base.shutdown import stop_on_signals

_FORKED = multiprocessing.get_context("forkserver")
_FORKED.set_forkserver_preload(
    ["drivers.core.kernels", "drivers.dynamixel.mixed", "drivers.feetech.bus", "drivers.maestro.bus"]
)
RAISE = "raise"


@contextmanager
def program(kind: str, servos: Sequence[ServoSpec], path: str, how: str = "", **options: Any) -> Iterator[BaseProcess]:
    """A process that drives the servos at a port up and down; with ``how`` "raise" until it fails by itself."""
    here, there = _FORKED.Pipe(duplex=False)
    child = _FORKED.Process(target=_drive, args=(there, kind, servos, path, how, options), daemon=True)
    child.start()
    there.close()
    try:
        with here:
            assert here.poll(30.0), "the program did not come up"
            assert here.recv() == "ready"
        yield child
    finally:
        child.kill()
        child.join()


def _drive(
    ready: Connection, kind: str, servos: Sequence[ServoSpec], path: str, how: str, options: dict[str, Any]
) -> None:
    bus = open_bus(kind, servos, port=path, **options)
    bus.open()
    with stop_on_signals(bus.close):
        bus.start()
        for k in range(100_000):
            bus.write(np.full(len(servos), 0.2 * np.sin(k / 10)))
            bus.read()
            if k == 3:
                ready.send("ready")
            if k == 5 and how == RAISE:
                raise SystemExit("in the loop")
            time.sleep(0.005)
