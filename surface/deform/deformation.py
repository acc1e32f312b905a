"""Differential update of a mesh, Eq. (2): numerators and denominators are kept, a change touches its cells only.

Drift is bounded in two ways. A cell takes at most ``LIMIT`` differences before it is computed anew from the
float64 control points; and its numerators are those of positions relative to its own origin, so that a rounding
error is 6e-8 of the cell's size, not of the head's.
"""

from __future__ import annotations

from functools import partial
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from surface.base.arrays import Floats, Ints
from surface.base.checks import check_ids, check_weights, integers, numbers
from surface.base.progress import Progress, silent
from surface.mesh.mesh import Mesh
from surface.spline.basis import pad_knots
from surface.spline.controlpoints import ControlPoints

from .relist import change_knots, change_weights
from .table import stencil_table

Table = TypeVar("Table", bound=ControlPoints)


class Deformation(Generic[Table]):
    """A mesh that follows its control points.

    Parameters
    ----------
    surface : the surface the mesh was made from
    mesh : from :meth:`surface.DCPSurface.tessellate`
    normals : also keep normals; without them an update costs a third
    threads : how many threads compute everything anew; updates of parts use one
    progress : is called with a stage and the part that is done, 0 to 1

    Attributes
    ----------
    vertices, normals : (m, 3) float32, current, read-only; (0, 3) without normals
    table : weights by cell; another one after a change of knots
    state : positions, and what is kept of the last update

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
        surface: Table,
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
        self.table = stencil_table(surface, mesh, normals=normals, progress=progress)
        self.state = self.table.new_state(surface.arrays()[4], threads)
        self.vertices, self.normals = _view(self.state.vertices), _view(self.state.normals)
        self._all, self._blocks, self._n = np.arange(surface.n), len(surface.shifts), surface.n
        self._make = partial(type(surface).from_padded, closed_u=surface.closed[0], closed_v=surface.closed[1])
        self.refresh()

    @property
    def points(self) -> np.ndarray:
        """(n, 3) float64 control points as they stand now, read-only."""
        view = self.state.points[: self._n]
        view.flags.writeable = False
        return view

    @property
    def changed(self) -> list[tuple[int, int]]:
        """Vertex ranges (start, stop) that the last update touched, rising."""
        return [(int(a), int(b)) for a, b in self.state.ranges[: self.state.count]]

    @property
    def surface(self) -> Table:
        """A new surface with the points, weights and knots as they stand now."""
        basis, own = self.table.basis, slice(0, self._n)
        return self._make(
            self.state.points[own],
            basis.weights[own],
            *(knots[own] for knots in basis.knots),
            *(degrees[own] for degrees in basis.degrees),
        )

    @property
    def nbytes(self) -> int:
        """Bytes of weights and lists."""
        return self.table.lists.nbytes

    def move(self, ids: ArrayLike, delta: ArrayLike) -> None:
        """Move points by ``delta (k, 3)`` (or one (3,) for all); an id that stands twice moves twice.

        Raises
        ------
        ValueError
            For ids out of range, wrong shapes or numbers that are not finite; nothing is changed then.
        """
        step = _rows(delta, "delta")
        if step.shape == (3,):
            step = np.tile(step, (np.size(ids), 1))
        self._place(ids, step, True)

    def set_positions(self, ids: ArrayLike, xyz: ArrayLike) -> None:
        """Put points ``ids (k,)`` at ``xyz (k, 3)``; points that stand there already cost next to nothing.

        Raises
        ------
        ValueError
            As :meth:`move`.
        """
        self._place(ids, _rows(xyz, "xyz"), False)

    def set_points(self, xyz: np.ndarray) -> None:
        """Put all points at ``xyz (n, 3)``: :meth:`set_positions` without a list of ids."""
        self._place(self._all, _rows(xyz, "xyz"), False)

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
        self.table.update(self.state, change_weights(self.table, which, w))

    def set_knots(self, index: int, knots_u: ArrayLike, knots_v: ArrayLike) -> None:
        """Give one point other knots, and so another subdomain; lists change only where the old or new one reaches.

        Raises
        ------
        ValueError
            For bad knots, or where a vertex of the mesh would be covered by no point; nothing is changed then.
        """
        index = int(check_ids([index], self._n)[0])
        rows = [pad_knots([k], name, 1) for k, name in ((knots_u, "knots_u"), (knots_v, "knots_v"))]
        self.table, cells = change_knots(self.table, index, [r[0][0] for r in rows], [int(r[1][0]) for r in rows])
        self.table.update(self.state, cells)

    def refresh(self) -> None:
        """Compute everything anew from the control points."""
        self.table.update(self.state)

    def _place(self, ids: ArrayLike, target: Floats, relative: bool) -> None:
        which = integers(ids)
        n, count = self._n, len(which)
        if target.shape != (count, 3):
            raise ValueError(f"{'delta' if relative else 'xyz'}: shape {target.shape}, expected {(count, 3)}")
        if count > n:  # ids that stand several times: the last position counts, moves add up
            which, target = _gathered(which, target, relative, n)
        if self._blocks > 1:
            which = self.table.basis.copies(check_ids(which, n))
            target = np.tile(target, (self._blocks, 1))
        self.table.update(self.state, (which, target, relative))


def _rows(rows: ArrayLike, name: str) -> Floats:
    """Float64 numbers in order, not copied where they are that already."""
    fast = isinstance(rows, np.ndarray) and rows.dtype.kind == "f"
    return np.ascontiguousarray(rows, dtype=np.float64) if fast else numbers(rows, name)


def _gathered(which: Ints, rows: Floats, relative: bool, n: int) -> tuple[Ints, Floats]:
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
