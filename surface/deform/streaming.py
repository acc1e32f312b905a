"""Writes vertices past the caches, where there are more of them than caches hold.

A store to memory that is in no cache first reads the whole cache line. Lines that are written as a whole and past the
caches are not read. So each cell's vertices are computed aside, and copied line by line.
"""

# mypy: allow-untyped-defs, disable-error-code="call-arg"
from __future__ import annotations

from surface.base.jit import inlined
from surface.spline.lanes import address, load, stream

MIN_BYTES = 1 << 23  # of vertices and normals, from which on they are streamed: more than the nearest caches hold
LINE = 16  # numbers of a cache line


@inlined
def stream_numbers(staged, start, count, out, at):
    """Copy ``staged[start : start + count]`` to ``out[at : at + count]``; whole lines go past the caches."""
    lead = min((-(address(out) // 4 + at)) % LINE, count)
    whole = lead + (count - lead) // LINE * LINE
    for k in range(lead):
        out[at + k] = staged[start + k]
    for k in range(lead, whole, LINE):
        stream(out, at + k, load(staged, start + k))
        stream(out, at + k + 8, load(staged, start + k + 8))
    for k in range(whole, count):
        out[at + k] = staged[start + k]


@inlined
def choose_places(staged, vertices, normals):
    """Return whether cells are streamed, and where to write their vertices and normals: to ``staged`` if there is any
    room."""
    out, out_normals = vertices, normals
    if staged.shape[0] > 0:
        out, out_normals = staged, staged[staged.shape[0] // 2 :]
    return staged.shape[0] > 0, out, out_normals


@inlined
def stream_cell(staged, count, first, vertices, normals):
    """Copy the ``count`` vertices of a cell, and normals if there are any, that :func:`choose_places` kept aside."""
    stream_numbers(staged, 0, 3 * count, vertices, 3 * first)
    if normals.shape[0] > 0:
        stream_numbers(staged, staged.shape[0] // 2, 3 * count, normals, 3 * first)
