"""Numbers that are written past the caches arrive where others would, and nothing beside them is touched."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from surface.bench.bench import sheet
from surface.deform import deformation as module
from surface.deform.streaming import LINE, stream_numbers


@njit
def run_stream(staged, start, count, out, at):
    stream_numbers(staged, start, count, out, at)


@pytest.mark.parametrize("shift", [0, 1, 5])  # of the memory, in numbers: it begins anywhere in a cache line
@pytest.mark.parametrize("at", [0, 3, LINE - 1, LINE])
@pytest.mark.parametrize("count", [0, 1, LINE - 1, LINE, 3 * LINE + 7])
def test_numbers_are_copied_from_any_place_to_any_place(shift: int, at: int, count: int) -> None:
    rng = np.random.default_rng(count)
    staged = rng.normal(size=9 * LINE).astype(np.float32)
    out = np.full(9 * LINE, np.nan, np.float32)[shift:]
    run_stream(staged, 4, count, out, at)
    assert out[at : at + count].tolist() == staged[4 : 4 + count].tolist()
    assert np.isnan(np.delete(out, np.arange(at, at + count))).all()


@pytest.mark.parametrize("normals", [False, True])
@pytest.mark.parametrize("threads", [1, 2])
def test_streamed_vertices_are_those_that_are_not(normals: bool, threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells of every kind: with factors, packed, with other orders of vertices, and at the mesh's end."""
    surface, mesh = sheet(60_000)
    moves = np.random.default_rng(4).normal(size=(surface.n, 3))
    rooms, found = list[int](), list[tuple[np.ndarray, np.ndarray]]()
    for least in (1 << 62, 0):
        monkeypatch.setattr(module, "MIN_BYTES", least)
        one = surface.deformation(mesh, normals=normals, threads=threads)
        rooms.append(len(one._arrays["staged"]))
        one.move(np.arange(surface.n), moves)
        one.move([30], np.ones(3))  # differences of few points are not streamed
        found.append((one.vertices.copy(), one.normals.copy()))
    assert rooms[0] == 0 < rooms[1]
    np.testing.assert_array_equal(found[0][0], found[1][0])
    np.testing.assert_array_equal(found[0][1], found[1][1])
