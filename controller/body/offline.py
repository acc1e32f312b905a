"""Plays a file on the heads of a stage as a run does, tick after tick, without waiting, links, voices and servos."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from controller.base.mailboxes import Mailbox
from controller.base.parameters import Flags, Floats
from controller.body.body import Body
from controller.body.messages import RunOptions
from controller.body.multi_head import MultiHeadBody
from controller.stage.stage import Stage, heads_of

_SCRIPT = ".toml"
_OUTSIDE: dict[str, Any] = {"links": [], "voice": None}
_SOURCES: dict[str, Any] = {"show": None, "take": None}
_EARLY = 1e-9  # of a tick: rounding of a time that is meant to be that of a tick


def play_offline(
    stage: Stage, path: Path, count: int, fps: float, values: Floats, held: Sequence[Flags]
) -> tuple[Floats, Floats]:
    """Return what a run of the stage shows at each frame of a film, if it plays a file from its first tick on.

    The layers, their settings and seeds, idle motion, motion limits and turns are those of the run. The file replaces
    the show, take and voice of the first head; other heads play their own shows and takes, and hear no voice.

    Parameters
    ----------
    path : take, recording (.rec) or show (.toml), which the first head plays. count, fps : number of frames, frames per
    second. values : (P,) full vector, whose parameters are held as by ``SET`` where ``held`` : (P,) bool, one for each
    head, is True; the faces have them from the beginning.

    Returns values (n, h, P) and lives (n, h, 2), breath and pupils (:meth:`surface.head.Head.live`), of n frames and h
    heads. Between ticks they are interpolated linearly.

    Raises TakeError, ConfigError or ControllerError: the file cannot be read, or a recording is of another stage.
    """
    shown = np.empty((count, len(heads_of(stage)), len(values) + 2))
    period_s = stage.period_s
    with _begun(_alone(stage), path, values, held) as (body, mailboxes):
        ticks, reached = _ticks(body, mailboxes, period_s), -1
        before = after = np.empty(0)
        for frame, row in enumerate(shown):
            place = frame / fps / period_s
            while reached < place - _EARLY:
                before, after = after, next(ticks)
                reached += 1
            share = min(place - reached + 1.0, 1.0)
            row[:] = after if reached == 0 else before + share * (after - before)
        body.check()
    return shown[..., :-2], shown[..., -2:]


def _alone(stage: Stage) -> Stage:
    """Return the stage without anything that is not the file: see :func:`play_offline`."""
    if not stage.heads:
        return _without(stage, _OUTSIDE | _SOURCES)
    heads = [
        replace(head, stage=_without(head.stage, _OUTSIDE | (_SOURCES if i == 0 else {})))
        for i, head in enumerate(stage.heads)
    ]
    return replace(stage, heads=tuple(heads))


def _without(stage: Stage, nothing: dict[str, Any]) -> Stage:
    return replace(stage, robots=(), settings=stage.settings.model_copy(update=nothing))


@contextmanager
def _begun(
    stage: Stage, path: Path, values: Floats, held: Sequence[Flags]
) -> Iterator[tuple[Body | MultiHeadBody, list[Mailbox]]]:
    """Yield the body of a stage that plays a file, not ticked yet, and the mailboxes of its heads."""
    file = path.resolve()  # not one of the same name beside the stage
    options = RunOptions(show=file) if file.suffix.lower() == _SCRIPT else RunOptions(take=file)
    with ExitStack() as closers:
        mailboxes = [closers.enter_context(Mailbox.create(len(values))) for _ in heads_of(stage)]
        several = MultiHeadBody(stage, stage.parameters, mailboxes, options=options) if stage.heads else None
        body = several or Body(stage, stage.parameters, mailboxes[0], options)
        bodies = [body] if isinstance(body, Body) else body.bodies
        closers.callback(body.stop)
        for each, which in zip(bodies, held, strict=True):
            indices = np.flatnonzero(which)
            each.state.set_parameters(indices.tolist(), values[indices].tolist(), 0)
            each.state.limiter.reset(np.where(which, values, stage.parameters.rest))
        body.begin()
        yield body, mailboxes


def _ticks(body: Body | MultiHeadBody, mailboxes: Sequence[Mailbox], period_s: float) -> Iterator[Floats]:
    """Yield after each tick what the heads show: (h, P + 2) values, breath and pupils."""
    shown = np.empty((len(mailboxes), mailboxes[0].count + 2))
    number = 0
    while True:
        number += 1
        body.tick(round(number * period_s * 1e9), period_s)
        for mailbox, row in zip(mailboxes, shown, strict=True):
            mailbox.read(row[:-2])
            row[-2:] = mailbox.life
        yield shown.copy()
