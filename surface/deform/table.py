"""How the vertices of a mesh are summed from its control points: a table, and one verb that brings vertices up to date.

As a subdivision library's stencil table, it is made once (:func:`stencil_table`) and serves any number of states. What
it holds follows from (u, v), knots and weights alone, so it stays as it is while points move. Other weights are written
into it, and for other knots another one is made of it (:mod:`surface.deform.relist`).
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import count

import numpy as np

from surface.base.arrays import Floats, Floats32, Ints
from surface.base.progress import Progress, silent
from surface.mesh.mesh import Mesh
from surface.spline.controlpoints import ControlPoints

from . import apply
from .binding import address_table, place_bound
from .lists import Lists, build_lists
from .rows import Basis
from .state import Parts, State

LIMIT = 256  # differences a cell takes before it is computed anew
BIAS = 6.0  # cost of one row's difference, in rows computed anew (measured)
GAP = 256  # unchanged vertices between two changed ranges that are uploaded rather than left out
PARTS = 4  # a thread's share of the cells is cut into
SMALL = 500_000  # weights below which one thread is as fast as two

Moves = tuple[Ints, Floats, bool]
Change = Moves | Ints | None


@dataclass(frozen=True, eq=False)
class StencilTable:
    """Weights and denominators by cell; nothing in it changes while control points move.

    Attributes
    ----------
    mesh : whose vertices these are
    basis : knots, degrees and weights of the control points
    lists : control points and weights of every cell
    origin : (c, 3) float64, what positions within a cell are relative to
    below, bend : (8 t,) and (16 t,) float32 by tile, one over the denominator and its derivatives in u and in v; see
        :mod:`surface.deform.apply`. ``bend`` is empty without normals
    sign : -1 where normals are turned against S_u x S_v, else 1
    """

    mesh: Mesh
    basis: Basis
    lists: Lists
    origin: Floats
    below: Floats32
    bend: Floats32
    sign: np.float32

    def update(self, state: State, change: Change = None) -> None:
        """Bring the vertices of ``state`` up to date, and say in its ``ranges`` which were touched.

        Parameters
        ----------
        state : from :meth:`new_state` of this table or one it was made of
        change : (ids (k,) int64, rows (k, 3) float64, relative) for points that move to ``rows``, or by them; cells
            (k,) int64, rising, that have other weights now; None for everything

        Raises
        ------
        ValueError
            For ids out of range or rows that are not finite; nothing is changed then.
        """
        if isinstance(change, tuple):
            ids, rows, relative = change
            if state.addressed is not self:
                self.address(state)
            found = place_bound(state.addresses, ids, rows, relative, state.most, LIMIT, BIAS, GAP, self.sign)
            if 0 <= found < 1 << 60:
                state.count = found
                return
            if found != -1:
                raise self._refusal(change, found + (1 << 61))
            change = None
        if state.bound is not self:
            self.bind(state)
        if change is None:
            self._update_all(state)
        else:
            apply.apply_cells(change.astype(np.int32), 0, len(change), *self._inputs(state))
            state.count = apply.ranges(change, len(change), self.lists.cell_start, GAP, state.ranges)

    def new_state(self, points: Floats, threads: int = 1) -> State:
        """A state with control points at ``points (n, 3)``, shifted copies included; its vertices are still zero."""
        tiles = int(self.lists.tile_start[-1])
        m, cells = len(self.mesh.vertices), len(self.origin)
        return State(points, m, cells, tiles, normals=len(self.bend) > 0, threads=threads)

    def bind(self, state: State) -> None:
        """Give a state room for this table's longest list; what it has of another table's is forgotten."""
        state.local = np.zeros((int(self.lists.rows.max(initial=0)), 3), dtype=np.float32)
        state.parts = state.addressed = None
        state.bound = self

    def address(self, state: State) -> None:
        """Put into a state where all arrays of both are, see :mod:`surface.deform.binding`."""
        if state.bound is not self:
            self.bind(state)
        state.addresses, state.addressed = address_table(arrays_of(self, state)), self

    def _refusal(self, change: Moves, bad: int) -> ValueError:
        which, rows, relative = change
        if bad < 0:
            return ValueError(f"ids[{-1 - bad}]: {which[-1 - bad]} is not a control point (0 to {self.basis.n - 1})")
        return ValueError(f"{'delta' if relative else 'xyz'}[{bad}]: must be finite, got {rows[bad].tolist()}")

    def _update_all(self, state: State) -> None:
        if state.threads == 1 or len(self.lists.value) < SMALL:
            apply.apply_cells(state.every, 0, len(state.every), *self._inputs(state))
        else:
            self._update_in_parts(state)
        state.ranges[0] = 0, len(self.mesh.vertices)
        state.count = 1

    def _update_in_parts(self, state: State) -> None:
        """Threads take one part after the other: where one is held up, the others do more."""
        if state.pool is None:
            state.pool = ThreadPoolExecutor(state.threads - 1, thread_name_prefix="surface")
        if state.parts is None:
            state.parts = self._cut(state)
        cuts, scratch = state.parts
        inputs, turns = self._inputs(state)[:-2], count()  # next(turns) is one step: no two threads take the same part

        def work(own: tuple[np.ndarray, np.ndarray]) -> None:
            while (part := next(turns)) < len(cuts) - 1:
                apply.apply_cells(state.every, cuts[part], cuts[part + 1], *inputs, *own)

        waiting = [state.pool.submit(work, own) for own in scratch[1:]]
        work(scratch[0])
        for done in waiting:
            done.result()

    def _cut(self, state: State) -> Parts:
        """First cells of parts with equal shares of the weights, and scratch for every thread."""
        total = np.cumsum(self.lists.rows * np.diff(self.lists.tile_start))
        parts = PARTS * state.threads
        cuts = [int(cell) for cell in np.searchsorted(total, total[-1] * np.arange(parts) / parts)]
        scratch = [(np.zeros_like(state.local), np.zeros_like(state.spare)) for _ in range(state.threads)]
        return [*cuts, len(total)], scratch

    def _inputs(self, state: State) -> tuple[object, ...]:
        x = self.lists
        return (
            state.points, self.origin, x.cell_start, x.tile_start, x.rows, x.room, x.at, x.ids_at, x.ids, x.value,
            x.slope, self.below, self.bend, state.numerators, state.kept, self.sign, state.vertices, state.normals,
            state.local, state.spare,
        )  # fmt: skip


def stencil_table(
    surface: ControlPoints, mesh: Mesh, *, normals: bool = True, progress: Progress = silent
) -> StencilTable:
    """The table of a mesh that was made from ``surface``; with derivative weights where ``normals`` are wanted."""
    cells = len(mesh.cell_start) - 1
    lists = build_lists(surface, mesh, normals, progress)
    tiles = int(lists.tile_start[-1])
    origin = np.zeros((cells, 3))
    if len(mesh.vertices):
        origin[:] = np.add.reduceat(mesh.vertices, mesh.cell_start[:-1]) / np.diff(mesh.cell_start)[:, None]
    table = StencilTable(
        mesh,
        Basis.of(surface),
        lists,
        origin,
        np.zeros(tiles * 8, dtype=np.float32),
        np.zeros(tiles * 16 if normals else 0, dtype=np.float32),
        np.float32(-1 if mesh.flip else 1),
    )
    sum_weights(table, np.arange(cells))
    return table


def sum_weights(table: StencilTable, cells: Ints) -> None:
    """Write the denominators of ``cells (k,)``."""
    x = table.lists
    apply.denominators(
        cells, x.cell_start, x.tile_start, x.rows, x.room, x.at, x.value, x.slope, table.below, table.bend
    )


def arrays_of(table: StencilTable, state: State) -> dict[str, np.ndarray]:
    """All arrays an update works on, by the names of :data:`surface.deform.binding.NAMES`."""
    own = {"origin": table.origin, "below": table.below, "bend": table.bend}
    return {k: v for k, v in (vars(table.lists) | own | vars(state)).items() if isinstance(v, np.ndarray)}
