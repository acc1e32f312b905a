"""The main function of the control process (body): receives orders over a pipe, runs the body, and reports."""

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
    """Run the control process.

    It sends to the main process a :class:`Ready`, perhaps a :class:`Finished`, and at the end a :class:`Report`, or at
    any time a :class:`Failed`. Main may send requests of its panel; ``Stop``, or the end of main, stops the body.
    """
    stop = threading.Event()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole process group; main stops the body
    for number in termination_signals():
        signal.signal(number, lambda *_: stop.set())
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
    """Run the body until a request to stop; its report is written to ``measured``, even if stopping a servo fails."""
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
    shorten_thread_switches()  # before torque is enabled, since it also shortens later garbage collections
    with _log_to(bodies[0].notes), ExitStack() as ending:
        if node is not None:
            ending.callback(node.close)
        ending.callback(lambda: measured.update(body.report()))  # runs after body.stop(), even if that fails
        ending.callback(body.stop)
        body.start()
        _send(pipe, messages.Ready())
        _wait(body, pipe, stop, panels[0])
    _send(pipe, messages.Report({**measured, **({"zenoh": node.report()} if node is not None else {})}))


@contextmanager
def _log_to(notes: logging.Handler) -> Iterator[None]:
    """Send warnings to ``notes`` for the panel, and also print them, which logging stops when it has a handler."""
    root, handlers = logging.getLogger(), [notes, *filter(None, [logging.lastResort])]
    for handler in handlers:
        root.addHandler(handler)
    try:
        yield
    finally:
        for handler in handlers:
            root.removeHandler(handler)


def _wait(body: Body | MultiHeadBody, pipe: Connection, stop: threading.Event, panel_state: PanelState | None) -> None:
    """Handle requests of main until it requests a stop or ends, a signal arrives, or ``body.check()`` raises."""
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
    """Carry out a request of main or its panel; return False if it requests a stop or has ended."""
    try:
        request = pipe.recv()
    except (EOFError, OSError):
        return False
    if isinstance(request, messages.Begin):
        shorten_thread_switches()
        request_realtime()  # links' threads inherit it: one that is preempted with the interpreter's lock delays servos
        body.begin()
        return True
    head = request.head if isinstance(request, messages.ToHead) else ""
    request = request.request if isinstance(request, messages.ToHead) else request
    try:
        return _carry_out(request, body.body_of(head) if isinstance(body, MultiHeadBody) else body, pipe)
    except Exception as error:  # a failed request of a panel must not end the run
        trace = error if os.environ.get("OMOTE_DEBUG") else None
        log.error("panel: %s failed: %s; all else goes on", type(request).__name__, describe(error), exc_info=trace)
        if isinstance(request, messages.AskDetails):
            _send(pipe, messages.Details())  # main asks again only after it has an answer
        return True


def _carry_out(request: object, body: Body, pipe: Connection) -> bool:
    """Carry out a request for one head; return False if it is not a request of a panel, but Stop."""
    if isinstance(request, messages.AskDetails):
        _send(pipe, body.details())
    elif isinstance(request, messages.PlayTake):
        body.play_take(request.path)
    elif isinstance(request, messages.Jog):
        body.jog(request.bus, request.servo, request.angle_deg)
    else:
        if isinstance(request, messages.Neutral):
            body.end_jogs()
        return carry_out(request, body.state, time.monotonic_ns())
    return True


def _send(pipe: Connection, message: object) -> None:
    with suppress(OSError):  # if main has ended, the body only has to stop the servos
        pipe.send(message)
