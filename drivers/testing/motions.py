"""The path of a shaft from the pieces of its motion: where it was, how fast it was, and when it jumped."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from drivers.testing.records import Piece

SAMPLES = 32
"""Samples of a piece of motion; its velocity is made of straight pieces, so few are enough."""


class Sample(NamedTuple):
    """Shaft at a time of the line's clock: position (ticks of the bare shaft), velocity (ticks/s)."""

    time_s: float
    position: float
    velocity: float


class Dash(NamedTuple):
    """A stretch in which a shaft was faster than allowed: its first and last sample, and its top speed (ticks/s)."""

    first: Sample
    last: Sample
    top_speed: float

    @property
    def way(self) -> float:
        """How far it went, ticks."""
        return abs(self.last.position - self.first.position)


def path(piece: Piece, end_s: float) -> list[Sample]:
    """Samples of a piece of motion that lasts until ``end_s``; one where the shaft stands."""
    trajectory, start_s = piece.trajectory, max(piece.start_s, piece.trajectory.start_s)
    if piece.jammed_at is not None:
        return [Sample(start_s, piece.jammed_at, 0.0)]
    stops_s = trajectory.start_s + trajectory.duration
    if not trajectory.at(end_s).velocity:
        end_s = min(end_s, stops_s)
    if end_s <= start_s:
        here = trajectory.at(start_s)
        return [Sample(start_s, here.position, 0.0 if start_s >= stops_s else here.velocity)]
    step_s = (end_s - start_s) / SAMPLES
    times = [start_s + k * step_s for k in range(SAMPLES)] + [end_s]
    return [Sample(time_s, *trajectory.at(time_s)[:2]) for time_s in times]


def paths(pieces: Sequence[Piece], end_s: float) -> Iterator[tuple[Piece, list[Sample]]]:
    """Each piece with its samples, in order."""
    ends = [after.start_s for _, after in pairwise(pieces)] + [end_s]
    for piece, piece_end_s in zip(pieces, ends, strict=True):
        yield piece, path(piece, piece_end_s)


def place_at(pieces: Sequence[Piece], time_s: float) -> float:
    """Where the shaft was at a time, ticks of the bare shaft."""
    piece = pieces[max(bisect_right(pieces, time_s, key=lambda each: each.start_s) - 1, 0)]
    return piece.trajectory.at(time_s).position if piece.jammed_at is None else piece.jammed_at


def dashes(pieces: Sequence[Piece], end_s: float, speed: float) -> list[Dash]:
    """Where a powered shaft is faster than ``speed`` (ticks/s), one after the other. Without power nothing counts."""
    found: list[Dash] = []
    run: list[Sample] = []
    for piece, samples in paths(pieces, end_s):
        for sample in samples:
            if piece.powered and abs(sample.velocity) > speed:
                run.append(sample)
            elif run:
                found.append(_dash([*run, sample] if piece.powered else run))
                run = []
    return [*found, _dash(run)] if run else found


def _dash(run: list[Sample]) -> Dash:
    return Dash(run[0], run[-1], max(abs(sample.velocity) for sample in run))
