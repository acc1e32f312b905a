"""Starts the control process (body) early, so that it loads its code while the main process reads the settings.

It imports no slow modules, because it runs before everything else.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import TYPE_CHECKING

from controller.base.signals import signals_blocked, unblock_signals
from drivers.base.permission import check_ports_allowed

if TYPE_CHECKING:
    from controller.base.mailboxes import Mailbox  # imported lazily: it loads numpy
    from controller.body.messages import BodyOrders  # imported lazily: it loads numpy

_END_S = 5.0


class PreloadedBody:
    """A process that waits for :class:`controller.body.messages.BodyOrders`.

    A context manager: the process ends with the block unless :meth:`send` was called.

    pipe : to the process. voice : pipe that carries standard input, which a child process does not have, to it.
    """

    def __init__(self) -> None:
        check_ports_allowed("start the process that drives the servos")
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        voice, self.voice = context.Pipe(duplex=False)
        self.process: SpawnProcess = context.Process(target=_wait, args=(theirs, voice), name="omote body")
        with signals_blocked(), _without_main_module():
            self.process.start()
        theirs.close()
        voice.close()
        self._sent = False

    def send(self, orders: BodyOrders, *mailboxes: Mailbox) -> None:
        """Send the process its orders and mailboxes; from now on the caller is responsible for ending it."""
        self._sent = True
        with suppress(OSError):  # if the process has ended, the caller that waits for its answer reports that
            self.pipe.send(orders)
            for mailbox in mailboxes:
                mailbox.send(self.pipe)

    def __enter__(self) -> PreloadedBody:
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if not self._sent:
            self.pipe.close()
            self.voice.close()
            self.process.terminate()
            self.process.join(_END_S)
            if self.process.exitcode is None:  # a signal that is sent while the process starts can be lost
                self.process.kill()
                self.process.join(_END_S)


@contextmanager
def garbage_collection_off() -> Iterator[None]:
    """Disable garbage collection: starting creates hardly any garbage, and collecting takes a tenth of its time."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


@contextmanager
def _without_main_module() -> Iterator[None]:
    """Keep a spawned process from importing the program that starts it, which the body does not need."""
    main = sys.modules["__main__"].__dict__
    removed = {name: main.pop(name) for name in ("__file__",) if name in main}
    try:
        yield
    finally:
        main.update(removed)


def _wait(pipe: Connection, voice: Connection) -> None:
    """Load the body's code, wait for orders, then run the body."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole process group; main stops the body
    unblock_signals()
    with garbage_collection_off():
        from controller.body.main import body_main  # imported lazily: in the child, while main reads its orders
    try:
        orders: BodyOrders = pipe.recv()
    except (EOFError, OSError):
        return
    options = orders.options
    if options.standard_input:
        os.dup2(voice.fileno(), sys.stdin.fileno())
    if options.voice is not None and options.voice.path == "-":
        orders = replace(orders, options=replace(options, voice=replace(options.voice, pipe=voice)))
    body_main(orders, pipe)
