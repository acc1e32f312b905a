"""The process of the body: gets its orders over a pipe, runs the body, and reports."""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing.connection import Connection

from controller.base.errors import OMOTE_ERRORS
from controller.base.mailboxes import Mailbox
from controller.base.parts import describe
from controller.base.signals import termination_signals
from controller.body import messages
from controller.body.body import Body
from controller.body.multi_head import MultiHeadBody
from controller.body.nodes import open_node
from controller.body.panel_requests import carry_out
from controller.body.panel_state import PanelState
from controller.layers.mixer import by_priority
from controller.stage.stage import heads_of
from drivers.base.priority import request_realtime, shorten_thread_switches
from drivers.base.shutdown import combine_with_context

log = logging.getLogger(__name__)

_POLL_S = 0.1


def body_main(orders: messages.BodyOrders, pipe: Connection) -> None:
    """Run the body's process.

    Sends to main one :class:`Ready` or :class:`Failed`, perhaps :class:`Finished`, at the end a :class:`Report`.
    Main may send requests of its panel; ``Stop`` and main's own end both mean stop.
    """
    stop = threading.Event()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; main asks the body to stop
    for ending in termination_signals():
        signal.signal(ending, lambda *_: stop.set())
    measured: dict[str, object] = {}
    try:
        _serve(orders, pipe, stop, measured)
    except OMOTE_ERRORS as error:
        with_earlier = combine_with_context(error)
        _send(pipe, messages.Failed(str(with_earlier), getattr(with_earlier, "hint", ""), measured))
    except Exception as error:
        if os.environ.get("OMOTE_DEBUG"):
            raise
        _send(pipe, messages.Failed(f"the body process failed: {type(error).__name__}: {error}", "", measured))


def _serve(orders: messages.BodyOrders, pipe: Connection, stop: threading.Event, measured: dict[str, object]) -> None:
    """Run the body until it is asked to stop; ``measured`` takes its report, also where a servo does not stop."""
    stage = orders.options.load_stage(orders.stage)
    parameters, mailboxes, panels = stage.parameters, [], []
    for each in heads_of(stage):
        mailboxes.append(Mailbox.receive(pipe, len(parameters)))
        panel = Mailbox.receive(pipe, PanelState.size(parameters))
        panels.append(PanelState(panel, [layer.name for layer in by_priority(each.layers)], parameters))
    body: Body | MultiHeadBody
    if stage.heads:
        body = MultiHeadBody(stage, parameters, mailboxes, panels, orders.options)
    else:
        body = Body(stage, parameters, mailboxes[0], orders.options)
    bodies = body.bodies if isinstance(body, MultiHeadBody) else [body]
    node = open_node(stage, bodies)
    shorten_thread_switches()  # before torque: later garbage collections have few objects to check
    with _logged(bodies[0].notes), ExitStack() as ending:
        if node is not None:
            ending.callback(node.close)
        ending.callback(lambda: measured.update(body.report()))  # comes after the stop, also one that fails
        ending.callback(body.stop)
        body.start()
        _send(pipe, messages.Ready())
        _wait(body, pipe, stop, panels[0])
    _send(pipe, messages.Report({**measured, **({"zenoh": node.report()} if node is not None else {})}))


@contextmanager
def _logged(notes: logging.Handler) -> Iterator[None]:
    """Keep warnings for who watches the body, and print them: with a handler of its own, logging prints nothing."""
    root, handlers = logging.getLogger(), [notes, *filter(None, [logging.lastResort])]
    for handler in handlers:
        root.addHandler(handler)
    try:
        yield
    finally:
        for handler in handlers:
            root.removeHandler(handler)


def _wait(body: Body | MultiHeadBody, pipe: Connection, stop: threading.Event, panel_state: PanelState | None) -> None:
    """Serve main until it requests a stop or has ended, a signal arrives, or a bus failed for good."""
    finished = False
    while not stop.is_set():
        if pipe.poll(_POLL_S) and not _handle(body, pipe):
            return
        if panel_state is not None:
            body.publish(panel_state)
        if body.finished and not finished:
            _send(pipe, messages.Finished())
            finished = True
        body.check()


def _handle(body: Body | MultiHeadBody, pipe: Connection) -> bool:
    """Carry out a request of main or its panel; False when it requests a stop or has ended."""
    try:
        request = pipe.recv()
    except (EOFError, OSError):
        return False
    if isinstance(request, messages.Begin):
        shorten_thread_switches()
        request_realtime()  # the links' threads too: one put off while it holds the interpreter puts off the servos
        body.begin()
        return True
    to = request.head if isinstance(request, messages.ToHead) else ""
    request = request.request if isinstance(request, messages.ToHead) else request
    try:
        return _answer(request, body.body_of(to) if isinstance(body, MultiHeadBody) else body, pipe)
    except Exception as error:  # nothing that a panel asks for ends the run
        trace = error if os.environ.get("OMOTE_DEBUG") else None
        log.error("panel: %s failed: %s; all else goes on", type(request).__name__, describe(error), exc_info=trace)
        if isinstance(request, messages.AskDetails):
            _send(pipe, messages.Details())  # it asks again only when it has an answer
        return True


def _answer(request: object, who: Body, pipe: Connection) -> bool:
    """Carry out a request for one head; False when it is none of a panel's, but asks to stop."""
    if isinstance(request, messages.AskDetails):
        _send(pipe, who.details())
    elif isinstance(request, messages.PlayTake):
        who.play_take(request.path)
    elif isinstance(request, messages.Jog):
        who.jog(request.bus, request.servo, request.angle_deg)
    else:
        if isinstance(request, messages.Neutral):
            who.end_jogs()
        return carry_out(request, who.state, time.monotonic_ns())
    return True


def _send(pipe: Connection, message: object) -> None:
    with suppress(OSError):  # main has ended; the servos are still stopped
        pipe.send(message)
