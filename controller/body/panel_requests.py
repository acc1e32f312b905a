"""Carries out the requests of the window's panel."""

from __future__ import annotations

import logging

import numpy as np

from controller.base.errors import ControllerError, ParameterError
from controller.body import messages
from controller.layers.commands import CommandState
from controller.vocabulary.expression import Expression

log = logging.getLogger(__name__)


def carry_out(request: object, state: CommandState, now_ns: int) -> bool:
    """Carry out a request; return False if it is not a request of a panel. A refused request is only logged."""
    try:
        return (
            _carry_out_hold(request, state, now_ns)
            or _carry_out_face(request, state, now_ns)
            or _carry_out_show(request, state)
            or _carry_out_servos(request, state, now_ns)
        )
    except ControllerError as error:
        log.warning("panel: %s", error)
        return True


def _carry_out_hold(request: object, state: CommandState, now: int) -> bool:
    match request:
        case messages.Hold(index, None):
            state.release([index], now)
        case messages.Hold(index, float(value)):
            state.set_parameters([index], [value], now)
        case messages.HoldAll(indices, None):
            state.release(list(indices), now)
        case messages.HoldAll(indices, tuple(values)):
            state.set_parameters(list(indices), list(values), now)
        case _:
            return False
    return True


def _carry_out_face(request: object, state: CommandState, now: int) -> bool:
    match request:
        case messages.Show(name, intensity):
            state.expression(name, intensity, None, now)
        case messages.LookAt(None):
            state.gaze_off(now)
        case messages.LookAt((x, y, z)):
            state.gaze_at(x, y, z, now)
        case messages.Live(amount, manner):
            state.live(amount, now, manner)
        case messages.Neutral(seconds):
            state.neutral(seconds, now)
        case messages.Learn(name, weights, kind):
            state.vocabulary.add(Expression(name, np.array(weights), kind))
        case _:
            return False
    return True


def _carry_out_show(request: object, state: CommandState) -> bool:
    if not isinstance(request, messages.PlayShow | messages.ControlShow):
        return False
    if state.shows is None:
        raise ParameterError("this process plays no shows")
    if isinstance(request, messages.PlayShow):
        state.shows.start(request.name)
    else:
        state.shows.control(request.what)
    return True


def _carry_out_servos(request: object, state: CommandState, now: int) -> bool:
    match request:
        case messages.StopServos():
            state.stop_latch.stop("panel", now)
        case messages.StartServos():
            state.stop_latch.start()
        case _:
            return False
    return True
