"""Differential update of a mesh, Eq. (2): numerators and denominators are kept, a change touches its cells only.

Drift is bounded in two ways. A cell takes at most ``LIMIT`` differences before it is computed anew from the
float64 control points; and its numerators are those of positions relative to its own origin, so that a rounding
error is 6e-8 of the cell's size, not of the head's.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from itertools import count
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from surface.base.checks import check_ids, check_weights, integers, numbers
from surface.base.progress import Progress, silent
from surface.mesh.mesh import Mesh
from surface.spline.basis import Floats, pad_knots

from .lists import build_lists

if TYPE_CHECKING:
    from surface.dcp import DCPSurface
    from surface.spline.bins import Bins

LIMIT = 256  # differences a cell takes before it is computed anew
BIAS = 6.0  # cost of one row's difference, in rows computed anew (measured)
GAP = 256  # unchanged vertices between two changed ranges that are uploaded rather than left out
PARTS = 4  # a thread's share of the cells is cut into
SMALL = 500_000  # weights below which one thread is as fast as two
MOST_MOVED = 0.75  # from this part of the points on, everything is computed anew


class Deformation:
    """A mesh that follows its control points.

    Parameters
    ----------
    surface : the surface the mesh was made from
    mesh : from :meth:`surface.DCPSurface.tessellate`
    normals : also keep normals; without them an update costs a third
    threads : how many threads compute everything anew; updates of parts use one
    progress : is called with a stage and the part that is done, 0 to 1

    Raises
    ------
    ValueError
        For no thread at all, or a mesh whose lists name points that the surface does not have.

    Notes
    -----
    One object belongs to one thread at a time. Nothing is allocated by :meth:`move` and :meth:`set_positions`
    but the copy of arguments that are not already int64 and float64 arrays.
    """

    def __init__(
        self,
        surface: DCPSurface,
        mesh: Mesh,
        *,
        normals: bool = True,
        threads: int = 1,
        progress: Progress = silent,
    ) -> None:
        if threads < 1:
            raise ValueError(f"threads: must be at least 1, not {threads}")
        if mesh.list_ids.max(initial=-1) >= len(surface.shifts) * surface.n:
            raise ValueError(f"mesh: was made from another surface: this one has {surface.n} points")
        self.mesh = mesh
        self._threads = threads
        self._pool: ThreadPoolExecutor | None = None
        self._lists = build_lists(surface, mesh, normals, progress)
        arrays = [array.copy() for array in surface.arrays()]
        self._knots, self._degrees = arrays[:2], arrays[2:4]
        self._points, self._weights = arrays[4:]
        self._n, self._shifts, self._closed = surface.n, surface.shifts, surface.closed
        self._allocate(normals)
        self._sum_weights(np.arange(len(mesh.cell_start) - 1))
        self.refresh()

    def _allocate(self, normals: bool) -> None:
        from .binding import place_bound  # once: an update of few points takes as long as an import statement

        n, m, cells = len(self._points), len(self.mesh.vertices), len(self.mesh.cell_start) - 1
        self._sign = np.float32(-1 if self.mesh.flip else 1)
        starts = self.mesh.cell_start[:-1]
        self._origin = np.zeros((cells, 3))
        if m:
            self._origin[:] = np.add.reduceat(self.mesh.vertices, starts) / np.diff(self.mesh.cell_start)[:, None]
        tiles = int(self._lists.tile_start[-1])
        self._below = np.zeros(tiles * 8, dtype=np.float32)
        self._bend = np.zeros(tiles * 16 if normals else 0, dtype=np.float32)
        self._state = np.zeros(tiles * (72 if normals else 24), dtype=np.float32)
        self._kept = np.full(cells, -1, dtype=np.int64)
        self._vertices = np.zeros(3 * m, dtype=np.float32)
        self._normals = np.zeros(3 * m if normals else 0, dtype=np.float32)
        self._hits = np.zeros(cells, dtype=np.int64)
        self._touched, self._anew = np.zeros(cells, dtype=np.int32), np.zeros(cells, dtype=np.int32)
        self._cells = np.arange(cells, dtype=np.int32)
        self._ranges = np.zeros((max(cells, 1), 2), dtype=np.int64)
        self._changed_ids, self._delta = np.zeros(n, dtype=np.int64), np.zeros((n, 3))
        self._all, self._most = np.arange(self._n), int(MOST_MOVED * n)
        self._call = place_bound
        self._cell_boxes: tuple[np.ndarray, Bins] | None = None
        self._spare = np.zeros(24, dtype=np.float32)
        self._count = 0
        self._reserve_local()
        self.vertices = _view(self._vertices)
        self.normals = _view(self._normals)

    def _reserve_local(self) -> None:
        """Room for the longest list; called whenever the lists' arrays may have been replaced."""
        self._table: np.ndarray | None = None
        self._parts: tuple[list[int], list[tuple[np.ndarray, np.ndarray]]] | None = None
        self._local = np.zeros((int(self._lists.rows.max(initial=0)), 3), dtype=np.float32)

    @property
    def points(self) -> np.ndarray:
        """(n, 3) float64 control points as they stand now, read-only."""
        view = self._points[: self._n]
        view.flags.writeable = False
        return view

    @property
    def changed(self) -> list[tuple[int, int]]:
        """Vertex ranges (start, stop) that the last update touched, rising."""
        return [(int(a), int(b)) for a, b in self._ranges[: self._count]]

    @property
    def surface(self) -> DCPSurface:
        """A new surface with the points, weights and knots as they stand now."""
        from surface.dcp import DCPSurface

        own = slice(0, self._n)
        return DCPSurface.from_padded(
            self._points[own],
            self._weights[own],
            *(knots[own] for knots in self._knots),
            *(degrees[own] for degrees in self._degrees),
            closed_u=self._closed[0],
            closed_v=self._closed[1],
        )

    @property
    def nbytes(self) -> int:
        """Bytes of weights and lists."""
        return self._lists.nbytes

    def move(self, ids: ArrayLike, delta: ArrayLike) -> None:
        """Move points by ``delta (k, 3)`` (or one (3,) for all); an id that stands twice moves twice.

        Raises
        ------
        ValueError
            For ids out of range, wrong shapes or numbers that are not finite; nothing is changed then.
        """
        step = _rows(delta, "delta")
        if step.shape == (3,):
            step = np.broadcast_to(step, (np.size(ids), 3))
        self._place(ids, step, "delta", True)

    def set_positions(self, ids: ArrayLike, xyz: ArrayLike) -> None:
        """Put points ``ids (k,)`` at ``xyz (k, 3)``; points that stand there already cost next to nothing.

        Raises
        ------
        ValueError
            As :meth:`move`.
        """
        self._place(ids, xyz, "xyz", False)

    def set_points(self, xyz: np.ndarray) -> None:
        """Put all points at ``xyz (n, 3)``: :meth:`set_positions` without a list of ids."""
        self._place(self._all, xyz, "xyz", False)

    def set_weights(self, ids: ArrayLike, weights: ArrayLike) -> None:
        """Give points ``ids (k,)`` the weights ``(k,)``, positive.

        Raises
        ------
        ValueError
            For ids out of range, wrong shapes or weights that are not positive and finite.
        """
        which = check_ids(ids, self._n)
        w = check_weights(weights)
        if w.shape != which.shape:
            raise ValueError(f"weights: shape {w.shape}, expected {which.shape}")
        which, w = self._copies(which), np.tile(w, len(self._shifts))
        self._weights[which] = w
        cells = [self._rewrite(int(i)) for i in which]
        self._recompute(np.unique(np.concatenate(cells)) if cells else np.zeros(0, dtype=np.int64))

    def set_knots(self, index: int, knots_u: ArrayLike, knots_v: ArrayLike) -> None:
        """Give one point other knots, and so another subdomain; lists change only where the old or new one reaches.

        Raises
        ------
        ValueError
            For bad knots, or where a vertex of the mesh would be covered by no point; nothing is changed then.
        """
        from .relist import change_knots

        index = int(check_ids([index], self._n)[0])
        rows = [pad_knots([k], name, 1) for k, name in ((knots_u, "knots_u"), (knots_v, "knots_v"))]
        self._apply(change_knots(self, index, [r[0][0] for r in rows], [int(r[1][0]) for r in rows]))

    def refresh(self) -> None:
        """Compute everything anew from the control points."""
        from . import apply

        cells = len(self._kept)
        if self._threads == 1 or len(self._lists.value) < SMALL:
            apply.apply_cells(self._cells, 0, cells, *self._inputs())
        else:
            self._refresh_in_parts()
        self._ranges[0] = 0, len(self.vertices)
        self._count = 1

    def _refresh_in_parts(self) -> None:
        """Threads take one part after the other: where one is held up, the others do more."""
        from . import apply

        if self._pool is None:
            self._pool = ThreadPoolExecutor(self._threads - 1, thread_name_prefix="surface")
        if self._parts is None:
            self._parts = self._cut()
        cuts, scratch = self._parts
        inputs, turns = self._inputs()[:-2], count()  # next(turns) is one step: no two threads take the same part

        def work(own: tuple[np.ndarray, np.ndarray]) -> None:
            while (part := next(turns)) < len(cuts) - 1:
                apply.apply_cells(self._cells, cuts[part], cuts[part + 1], *inputs, *own)

        waiting = [self._pool.submit(work, own) for own in scratch[1:]]
        work(scratch[0])
        for done in waiting:
            done.result()

    def _cut(self) -> tuple[list[int], list[tuple[np.ndarray, np.ndarray]]]:
        """First cells of parts with equal shares of the weights, and scratch for every thread."""
        total = np.cumsum(self._lists.rows * np.diff(self._lists.tile_start))
        parts = PARTS * self._threads
        cuts = [int(cell) for cell in np.searchsorted(total, total[-1] * np.arange(parts) / parts)]
        scratch = [(np.zeros_like(self._local), np.zeros_like(self._spare)) for _ in range(self._threads)]
        return [*cuts, len(total)], scratch

    def _place(self, ids: ArrayLike, rows: ArrayLike, name: str, relative: bool) -> None:
        which, target = integers(ids), _rows(rows, name)
        n, count = self._n, len(which)
        if target.shape != (count, 3):
            raise ValueError(f"{name}: shape {target.shape}, expected {(count, 3)}")
        if count > n:  # ids that stand several times: the last position counts, moves add up
            which, target = _gathered(which, target, relative, n)
        if len(self._shifts) > 1:
            which = self._copies(check_ids(which, self._n))
            target = np.tile(target, (len(self._shifts), 1))
        table = self._addresses() if self._table is None else self._table
        found = self._call(table, which, target, relative, self._most, LIMIT, BIAS, GAP, self._sign)
        if found == -1:
            self.refresh()
        elif found < 0 or found >= 1 << 60:
            self._complain(which, target, found + (1 << 61), name)
        else:
            self._count = found

    def _complain(self, which: np.ndarray, target: np.ndarray, bad: int, name: str) -> None:
        if bad < 0:
            raise ValueError(f"ids[{-1 - bad}]: {which[-1 - bad]} is not a control point (0 to {self._n - 1})")
        raise ValueError(f"{name}[{bad}]: must be finite, got {target[bad].tolist()}")

    def _rewrite(self, i: int) -> np.ndarray:
        """Compute the rows of point i anew; returns the cells it stands in."""
        from surface.spline import weighing

        lists = self._lists
        entries = slice(lists.back_start[i], lists.back_start[i] + lists.back_count[i])
        cells = lists.back_cell[entries].astype(np.int64)
        places = lists.back_row[entries].astype(np.int64)
        nonzero = np.zeros(len(cells), dtype=np.bool_)
        weighing.rewrite_rows(
            *self._knots, *self._degrees, self._weights, self.mesh.uv, self.mesh.side, lists.cell_start, i,
            cells, places, lists.value, lists.slope, lists.at, lists.room, nonzero,
        )  # fmt: skip
        return cells

    def _sum_weights(self, cells: np.ndarray) -> None:
        from . import apply

        x = self._lists
        apply.denominators(
            cells, x.cell_start, x.tile_start, x.rows, x.room, x.at, x.value, x.slope, self._below, self._bend
        )

    def _recompute(self, cells: np.ndarray) -> None:
        """Denominators and vertices of the given rising cells."""
        self._sum_weights(cells)
        self._apply(cells)

    def _apply(self, cells: np.ndarray) -> None:
        """Vertices of the given rising cells."""
        from . import apply

        apply.apply_cells(cells.astype(np.int32), 0, len(cells), *self._inputs())
        self._count = apply.ranges(cells, len(cells), self._lists.cell_start, GAP, self._ranges)

    def _tables(self) -> tuple[np.ndarray, ...]:
        x = self._lists
        return x.cell_start, x.tile_start, x.rows, x.room, x.at, x.ids_at, x.ids, x.value, x.slope

    def _inputs(self) -> tuple:
        return (
            self._points, self._origin, *self._tables(), self._below, self._bend, self._state, self._kept, self._sign,
            self._vertices, self._normals, self._local, self._spare,
        )  # fmt: skip

    def _arrays(self) -> dict[str, np.ndarray]:
        """All arrays an update works on; :mod:`surface.deform.binding` keeps their addresses."""
        own = ["changed_ids", "delta", "hits", "touched", "anew", "ranges", "points", "origin", "below", "bend"]
        own += ["state", "kept", "vertices", "normals", "local", "spare"]
        return vars(self._lists) | {name: getattr(self, f"_{name}") for name in own}

    def _addresses(self) -> np.ndarray:
        """The table that :mod:`surface.deform.binding` takes, made anew where an array was replaced."""
        from . import binding

        if self._table is None:
            self._table = binding.address_table(self._arrays())
        return self._table

    def _copies(self, which: np.ndarray) -> np.ndarray:
        """Points and their shifted copies, block after block."""
        return np.concatenate([which + block * self._n for block in range(len(self._shifts))])


def _rows(rows: ArrayLike, name: str) -> Floats:
    """Float64 numbers in order, not copied where they are that already."""
    fast = isinstance(rows, np.ndarray) and rows.dtype.kind == "f"
    return np.ascontiguousarray(rows, dtype=np.float64) if fast else numbers(rows, name)


def _gathered(which: np.ndarray, rows: np.ndarray, relative: bool, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Each id once."""
    if (which < 0).any() or (which >= n).any():
        return which[:n], rows[:n]  # refused later, and by then short enough for the work space
    if not relative:
        unique, last = np.unique(which[::-1], return_index=True)
        return unique, np.ascontiguousarray(rows[::-1][last])
    unique, back = np.unique(which, return_inverse=True)
    total = np.zeros((len(unique), 3))
    np.add.at(total, back, rows)
    return unique, total


def _view(flat: np.ndarray) -> np.ndarray:
    """(m, 3) read-only view."""
    view = flat.reshape(-1, 3)
    view.flags.writeable = False
    return view
