"""The body's process before there is anything for it to do: it loads its code while main still reads its orders.

Imports nothing that takes long: it is what starts first.
"""

from __future__ import annotations

import gc
import multiprocessing
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from types import TracebackType
from typing import TYPE_CHECKING

from controller.base.signals import interrupts_blocked

if TYPE_CHECKING:
    from controller.body.messages import BodyOrders  # start-up: it loads numpy

_END_S = 5.0


class PreloadedBody:
    """A process that waits for :class:`controller.body.messages.BodyOrders`.

    A context manager: it ends with the block unless :meth:`send` has sent it to work.

    Attributes
    ----------
    pipe : to the process. process : the process.
    voice : what is written here the body hears where its voice comes from standard input, which a child has not.
    """

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        heard, self.voice = context.Pipe(duplex=False)
        self.process: SpawnProcess = context.Process(target=_wait, args=(theirs, heard), name="omote body")
        with interrupts_blocked(), _main_left_out():
            self.process.start()
        theirs.close()
        heard.close()
        self._sent = False

    def send(self, orders: BodyOrders) -> None:
        """Give the process its orders; from now on it is the caller's to end."""
        self._sent = True
        with suppress(OSError):  # a process that is gone is told by whoever waits for its answer
            self.pipe.send(orders)

    def __enter__(self) -> PreloadedBody:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not self._sent:
            self.pipe.close()
            self.voice.close()
            self.process.terminate()
            self.process.join(_END_S)
            if self.process.exitcode is None:  # what is asked of a process while it starts can be lost
                self.process.kill()
                self.process.join(_END_S)


@contextmanager
def uncollected() -> Iterator[None]:
    """Collect no garbage: next to nothing of what a start loads is any, and looking takes a tenth of the start."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


@contextmanager
def _main_left_out() -> Iterator[None]:
    """A spawned process imports the program it was started from; the body needs no command line."""
    main = sys.modules["__main__"].__dict__
    left_out = {name: main.pop(name) for name in ("__file__",) if name in main}
    try:
        yield
    finally:
        main.update(left_out)


def _wait(pipe: Connection, heard: Connection) -> None:
    """Load the body's code, then be the body."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; main tells the body when
    with uncollected():
        from controller.body.body import body_main  # start-up: in the child, while main reads its orders
    try:
        orders: BodyOrders = pipe.recv()
    except (EOFError, OSError):
        return
    if orders.voice is not None and orders.voice.path == "-":
        orders = replace(orders, voice=replace(orders.voice, pipe=heard))
    body_main(orders, pipe)
