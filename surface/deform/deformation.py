"""Meshes that follow their control points: the differential update, Eq. (2), touches the cells of a change only.

Numerators and denominators are kept. Drift is bounded in three ways. The numerators of a cell are those of positions
relative to its own origin, so that a rounding error is 6e-8 of the cell's size, not of the head's. A cell takes at most
``LIMIT`` differences before it is computed again from the float64 control points; and it is computed again before its
rounding errors can add up to more than 8e-7 of the surface's size, however far its points have been (see
:mod:`.updates`).
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import count
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from surface.base.arrays import Floats, Ints
from surface.base.checks import check_ids, check_weights, integers, numbers
from surface.base.progress import Progress, no_progress
from surface.mesh.mesh import Mesh
from surface.spline.basis import pad_knots
from surface.spline.controlpoints import ControlPoints

from . import apply, edits
from .binding import address_table
from .denominators import denominators, farthest, first_unusable
from .lists import LANES, Basis, build_lists
from .merging import merge_cells
from .storage import compress
from .updates import REFUSED, measure, move_points
from .working import middles, work_arrays

Table = TypeVar("Table", bound=ControlPoints)
LIMIT = 256  # differences that a cell takes before it is computed again
BIAS = 6.0  # cost of one row's difference, relative to computing a row again (measured)
GAP = 256  # changed ranges with fewer unchanged vertices between them are joined
RECOMPUTE_FRACTION = 0.75  # of the points moved, from which on everything is computed again
PARTS = 4  # into which the cells of a thread are divided
SMALL = 500_000  # number of weights below which one thread is as fast as two


class Deformation(Generic[Table]):
    """A mesh that follows its control points.

    Parameters
    ----------
    surface : the surface the mesh was made from
    mesh : from :meth:`surface.DCPSurface.tessellate`
    normals : also keep normals; without them an update costs a third
    threads : how many threads compute everything again; updates of parts use one
    progress : is called with a stage and the part that is done, 0 to 1

    Attributes
    ----------
    vertices, normals : (m, 3) float32, current, read-only; (0, 3) without normals
    mesh, basis : the mesh, with larger cells where they are better; knots, degrees and weights of the control points
    lists, storage : their weights by cell, where these are kept as blocks, and where they are packed or products

    ``ValueError`` for no thread at all, a mesh of a surface with other control points or other knots, or weights so
    small, or weights, derivatives or places so large, at a vertex that 32-bit numbers cannot hold them.

    One object belongs to one thread at a time. Updates of parts, by :meth:`move` and :meth:`set_positions`,
    allocate nothing but copies of arguments: those that are not int64 and float64 arrays already, and those of periodic
    surfaces.
    """

    def __init__(
        self, surface: Table, mesh: Mesh, *, normals: bool = True, threads: int = 1, progress: Progress = no_progress
    ) -> None:
        if threads < 1:
            raise ValueError(f"threads: must be at least 1, not {threads}")
        if mesh.list_ids.max(initial=-1) >= len(surface.shifts) * surface.n:
            raise ValueError(f"mesh: was made from another surface: this one has {surface.n} points")
        if mesh.structure and mesh.structure != surface.structure:
            raise ValueError("mesh: was made from another surface, with other knots: tessellate this one")
        self.mesh, self.basis = merge_cells(mesh), Basis.of(surface)
        self.lists = build_lists(surface, self.mesh, normals, progress)
        self._work = self.lists.rows * np.diff(self.lists.tile_start) * LANES  # weights by cell, however they are kept
        self.storage = compress(self.basis, self.lists, self.mesh, surface.arrays()[4])
        self._sign, self._threads = np.float32(-1 if mesh.flip else 1), threads
        self._most = int(RECOMPUTE_FRACTION * len(surface.arrays()[4]))
        self._pool: ThreadPoolExecutor | None = None  # started when first used
        self._make = partial(type(surface).from_padded, closed_u=surface.closed[0], closed_v=surface.closed[1])
        self._arrays = work_arrays(self.mesh, surface.arrays()[4], int(self.lists.tile_start[-1]), normals)
        self._points, self._ranges, self._count = self._arrays["points"], self._arrays["ranges"], 0
        self._all, self._cells = np.arange(surface.n), np.arange(len(self.mesh.cell_start) - 1, dtype=np.int32)
        self.vertices, self.normals = _view(self._arrays["vertices"]), _view(self._arrays["normals"])
        self._bind()
        self._sum_weights(np.arange(len(self._cells)))
        self._check_weights("mesh", np.arange(len(self._cells)))
        measure(self._points, self._arrays["extent"], True)
        if self._is_elsewhere(mesh.vertices):
            self._recentre()
        else:
            self.refresh()

    @property
    def points(self) -> np.ndarray:
        """(n, 3) float64, the current control points, read-only."""
        view = self._points[: self.basis.n]
        view.flags.writeable = False
        return view

    @property
    def changed(self) -> list[tuple[int, int]]:
        """Vertex ranges (start, stop) that the last update touched, ascending."""
        return [(int(a), int(b)) for a, b in self._ranges[: self._count]]

    @property
    def surface(self) -> Table:
        """A new surface with the current points, weights and knots."""
        n, basis = self.basis.n, self.basis
        rows = [array[:n] for array in (self._points, basis.weights, *basis.knots, *basis.degrees)]
        return self._make(*rows)

    @property
    def nbytes(self) -> int:
        """Bytes of weights and lists."""
        return self.lists.nbytes + self.storage.nbytes

    def move(self, ids: ArrayLike, delta: ArrayLike) -> None:
        """Move points by ``delta (k, 3)`` (or one (3,) for all); an id that is given twice moves twice.

        ``ValueError`` for ids out of range, wrong shapes, numbers that are not finite, or places so far away that
        their sums with the surface's weights are beyond 32-bit numbers; nothing is changed then.
        """
        step = _rows(delta, "delta")
        if step.shape == (3,):
            step = np.tile(step, (np.size(ids), 1))
        self._place(ids, step, True)

    def set_positions(self, ids: ArrayLike, xyz: ArrayLike) -> None:
        """Put points ``ids (k,)`` at ``xyz (k, 3)``, errors as :meth:`move`; those there already cost little."""
        self._place(ids, _rows(xyz, "xyz"), False)

    def set_points(self, xyz: np.ndarray) -> None:
        """Put all points at ``xyz (n, 3)``: :meth:`set_positions` without a list of ids."""
        self._place(self._all, _rows(xyz, "xyz"), False)

    def own_arrays(self) -> dict[str, np.ndarray]:
        """Return what differs between deformations of one mesh that share weights and knots, by the names of
        :data:`.binding.NAMES`."""
        return {
            name: self._arrays[name] for name in ("points", "origin", "vertices", "normals", "differences", "extent")
        }

    def addressed(self) -> dict[str, np.ndarray]:
        """Return all arrays that kernels take, by the names of :data:`.binding.NAMES`."""
        return vars(self.lists) | self._arrays | self.storage.arrays

    def work(self) -> tuple[np.ndarray, np.float32, list[np.ndarray]]:
        """Return what kernels take besides: all cells, the sign of normals, scratch space of a thread."""
        return self._cells, self._sign, [np.zeros_like(room) for room in self._scratch()]

    @property
    def weights_of_cells(self) -> Ints:
        """(c,) how many weights each cell had when the deformation was made, however they are kept."""
        return self._work

    def set_weights(self, ids: ArrayLike, weights: ArrayLike) -> None:
        """Give points ``ids (k,)`` the weights ``(k,)``, positive.

        ``ValueError`` for ids out of range, wrong shapes, weights that are not positive and finite, or so large that
        sums are beyond 32-bit numbers; nothing is changed then.
        """
        which = check_ids(ids, self.basis.n)
        w = check_weights(weights)
        if w.shape != which.shape:
            raise ValueError(f"weights: shape {w.shape}, expected {which.shape}")
        before = self.basis.weights[which]
        try:
            cells = self._change_weights(which, w)
        except ValueError:
            self._change_weights(which, before)
            raise
        self._update(cells)

    def _change_weights(self, which: Ints, weights: Floats) -> Ints:
        """Give points other weights; returns the cells that changed. ``ValueError`` where a vertex has none then."""
        cells = edits.change_weights(self.basis, self.lists, self.storage, self.mesh, which, weights)
        self._bind()
        self._sum_weights(cells)
        self._check_weights("weights", cells)
        return cells

    def set_knots(self, index: int, knots_u: ArrayLike, knots_v: ArrayLike) -> None:
        """Give one point other knots, and so another subdomain; lists change only where the old or new one reaches.

        ``ValueError`` for bad knots, or where no point would cover a vertex of the mesh; nothing is changed then.
        """
        index = int(check_ids([index], self.basis.n)[0])
        rows = [pad_knots([k], name, 1) for k, name in ((knots_u, "knots_u"), (knots_v, "knots_v"))]
        knots, degrees = [row[0][0] for row in rows], [int(row[1][0]) for row in rows]
        basis = self.basis
        before = [k[index, : p[index] + 2].copy() for k, p in zip(basis.knots, basis.degrees, strict=True)]
        cells = self._change_knots(index, knots, degrees)
        try:
            self._check_weights("knots_u, knots_v", cells)
        except ValueError:
            self._change_knots(index, before, [len(k) - 2 for k in before])
            raise
        self._update(cells)

    def _change_knots(self, index: int, knots: list[Floats], degrees: list[int]) -> Ints:
        """Give a point other knots; returns the cells that changed, whose weights are summed."""
        try:
            cells = edits.change_knots(self.basis, self.lists, self.storage, self.mesh, index, knots, degrees)
        finally:
            self._bind()
        self._sum_weights(cells)
        return cells

    def write_to(self, vertices: np.ndarray, normals: np.ndarray) -> None:
        """Keep vertices and normals in these arrays (m, 3) float32, contiguous, from now on; they get the current ones.

        Whoever owns them may overwrite rows, which then stay so until their cell is updated. ``ValueError`` for arrays
        of another kind.
        """
        for name, array in (("vertices", vertices), ("normals", normals)):
            mine = self._arrays[name]
            if array.size != mine.size or array.dtype != mine.dtype or not array.flags.c_contiguous:
                raise ValueError(f"{name}: must be contiguous float32 of shape {getattr(self, name).shape}")
            array.reshape(-1)[:] = mine
            self._arrays[name] = array.reshape(-1)
            setattr(self, name, _view(self._arrays[name]))
        self._bind()

    def refresh(self) -> None:
        """Compute everything again from the control points."""
        if self._threads == 1 or self._work.sum() < SMALL:
            self._compute(self._cells)
        else:
            self._compute_in_parts()
        self._ranges[0] = 0, len(self.mesh.vertices)
        self._count = 1

    def _place(self, ids: ArrayLike, target: Floats, relative: bool) -> None:
        """Move points, or put them somewhere, and update the mesh."""
        which = integers(ids)
        n, copies, name = self.basis.n, len(self.basis.shifts), "delta" if relative else "xyz"
        if target.shape != (len(which), 3):
            raise ValueError(f"{name}: shape {target.shape}, expected {(len(which), 3)}")
        if len(which) > n:  # ids that are given several times: the last position counts, moves add up
            which, target = _sum_by_id(check_ids(which, n), target, relative)
        if copies > 1:
            which, target = self.basis.copies(check_ids(which, n)), np.tile(target, (copies, 1))
        found = move_points(self._addresses, which, target, relative, self._most, LIMIT, BIAS, GAP, self._sign)
        if found >= 0:
            self._count = found
        elif found == -1:
            self.refresh()
        elif found == -2:
            self._recentre()
        else:
            check_ids(which, n * copies)
            bad = found + REFUSED
            wanted = "finite"
            if np.isfinite(target[bad]).all():
                most = f"{self._arrays['extent'][3]:.3g}"
                wanted = f"within {most}, and lead to places that are (sums beyond leave the range of 32-bit numbers)"
            raise ValueError(f"{name}[{bad}]: must be {wanted}, got {target[bad].tolist()}")

    def _recentre(self) -> None:
        """Compute everything again, from origins in the middle of the cells as they are now.

        To find these, origins are one of the cell's points first: the old ones may be so far away that all digits of
        the vertices are lost.
        """
        self._arrays["origin"][:] = self._points[self.lists.ids[self.lists.ids_at]]
        self.refresh()
        self._arrays["origin"][:] = middles(self.vertices, self.mesh.cell_start)
        self.refresh()

    def _is_elsewhere(self, vertices: np.ndarray) -> bool:
        """Whether a mesh's vertices (m, 3), which origins were chosen by, are far away from the points."""
        low, high, size = self._points.min(axis=0), self._points.max(axis=0), self._arrays["extent"][0]
        return bool(len(vertices) and ((vertices < low - size) | (vertices > high + size)).any())

    def _bind(self) -> None:
        """Make room for the longest list and the sums of groups, and take the addresses of all arrays, which may have
        been replaced."""
        self._arrays["local"] = np.zeros((int(self.lists.rows.max(initial=0)) + 1, 3), dtype=np.float32)
        self._arrays["starts"] = np.zeros(len(self._arrays["local"]), dtype=np.int32)
        self._arrays["scratch"] = np.zeros(self.storage.factors.sums, dtype=np.float32)
        self._addresses = address_table(self.addressed())

    def _sum_weights(self, cells: Ints) -> None:
        denominators(self._addresses, cells)
        self._arrays["extent"][3] = farthest(self._arrays["heavy"])

    def _check_weights(self, name: str, cells: Ints) -> None:
        """``ValueError`` for the first vertex of ``cells`` whose weights 32-bit numbers cannot hold, or for places that
        are so far away that these cannot hold their sums."""
        arrays = self._arrays
        order = self.storage.packed.order_at, self.storage.packed.order
        bad = first_unusable(cells, self.lists.cell_start, self.lists.tile_start, arrays["inv_w"], arrays["dw"], *order)
        if bad >= 0:
            u, v = self.mesh.uv[bad]
            raise ValueError(
                f"{name}: at vertex {bad} of the mesh (u = {u:g}, v = {v:g}) the weights of all control points add "
                "up to nearly nothing, or their derivatives to more than 32-bit numbers hold: scale weights or knots"
            )
        far, most = max(self._points.max(), -self._points.min()), arrays["extent"][3]
        if far > most:
            raise ValueError(
                f"{name}: points are up to {far:.3g} away from 0; with these weights and knots sums leave the range of "
                f"32-bit numbers beyond {most:.3g}: move the points nearer, or scale weights or knots"
            )

    def _update(self, cells: Ints) -> None:
        """Bring ``cells (k,)``, ascending, up to date with their changed weights, which are summed."""
        self._compute(cells.astype(np.int32))
        self._count = apply.join_ranges(cells, len(cells), self.lists.cell_start, GAP, self._ranges)

    def _compute(self, cells: np.ndarray) -> None:
        apply.compute_cells(self._addresses, cells, 0, len(cells), self._sign, *self._scratch())

    def _scratch(self) -> list[np.ndarray]:
        """Return scratch space of the kernels."""
        return [self._arrays[name] for name in ("local", "scratch", "starts")]

    def _compute_in_parts(self) -> None:
        """Threads take parts with equal shares of the weights, one after the other: a delayed thread does fewer."""
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self._threads - 1, thread_name_prefix="surface")
        total = np.cumsum(self._work)
        parts = PARTS * self._threads
        cuts = [*np.searchsorted(total, total[-1] * np.arange(parts) / parts).tolist(), len(total)]
        turns = count()  # next(turns) is one step: no two threads take the same part

        def work() -> None:
            rooms = [np.zeros_like(room) for room in self._scratch()]
            while (part := next(turns)) < parts:
                begin, end = cuts[part], cuts[part + 1]
                apply.compute_cells(self._addresses, self._cells, begin, end, self._sign, *rooms)

        waiting = [self._pool.submit(work) for _ in range(self._threads - 1)]
        work()
        for done in waiting:
            done.result()


def _rows(rows: ArrayLike, name: str) -> Floats:
    """Return float64 numbers in order, not copied where they are that already."""
    if type(rows) is np.ndarray and rows.dtype == np.float64 and rows.flags.c_contiguous:
        return rows
    fast = isinstance(rows, np.ndarray) and rows.dtype.kind == "f"
    return np.ascontiguousarray(rows, dtype=np.float64) if fast else numbers(rows, name)


def _sum_by_id(which: Ints, rows: Floats, relative: bool) -> tuple[Ints, Floats]:
    """Return each id once, with its sum of moves or its last position."""
    if not relative:
        unique, last = np.unique(which[::-1], return_index=True)
        return unique, np.ascontiguousarray(rows[::-1][last])
    unique, back = np.unique(which, return_inverse=True)
    total = np.zeros((len(unique), 3))
    np.add.at(total, back, rows)
    return unique, total


def _view(flat: np.ndarray) -> np.ndarray:
    """Return (m, 3): read-only view."""
    view = flat.reshape(-1, 3)
    view.flags.writeable = False
    return view
