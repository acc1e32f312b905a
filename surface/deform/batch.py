"""Many copies of one deformation, computed in one batch: their weights are read once for all of them.

Cells are taken in slices whose weights stay in the processor's cache while every copy is computed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats, Floats32, Ints
from surface.base.jit import nonallocating

from .apply import compute_cells
from .binding import address_table
from .deformation import Deformation
from .lists import LANES
from .updates import measure
from .working import middles

SLICE_BYTES = 200_000  # of weights: with what belongs to them, they fit a core's own cache
WEIGHT_BYTES = 7  # of a packed weight and of its derivatives in u and v


@nonallocating
def compute_copies(tables, copies, cells, cuts, sign, local, scratch, starts):  # type: ignore[no-untyped-def]
    """Compute all ``cells`` of ``copies (k,)``, one slice ``cuts[i]`` to ``cuts[i + 1]`` after the other.

    ``tables (h, 2 n)`` : what each copy passes to :func:`.apply.compute_cells`; the last three are its scratch space.
    """
    for part in range(len(cuts) - 1):
        for k in range(len(copies)):
            compute_cells(tables[copies[k]], cells, cuts[part], cuts[part + 1], sign, local, scratch, starts)


class DeformationBatch:
    """Copies of a deformation, each with control points of its own; all share its mesh, weights and knots.

    Parameters
    ----------
    source : the deformation, of which neither weights nor knots may change while the batch is used.
    count : number of copies. All begin with the source's present control points.

    Attributes
    ----------
    points : (h, n, 3) float64; vertices, normals : (h, m, 3) float32, as :meth:`compute` left them; all read-only.

    ``ValueError`` for fewer than one copy.
    """

    def __init__(self, source: Deformation[Any], count: int) -> None:
        if count < 1:
            raise ValueError(f"count: must be at least 1, not {count}")
        self._source, own = source, source.own_arrays()
        self._arrays = {name: _repeat(array, count) for name, array in own.items()}
        self._n, self._copies = source.basis.n, len(source.basis.shifts)
        every = [{name: array[k] for name, array in self._arrays.items()} for k in range(count)]
        self._tables = np.stack([address_table(source.addressed() | arrays) for arrays in every])
        self._cells, self._sign, self._scratch = source.work()
        self._cuts = slices(source.weights_of_cells * WEIGHT_BYTES, SLICE_BYTES)
        self._waiting: dict[int, None] = {}
        shape = count, len(source.vertices), 3
        self.vertices = _read_only(self._arrays["vertices"].reshape(shape))
        self.normals = _read_only(self._arrays["normals"].reshape(count, len(source.normals), 3))
        self.points = _read_only(self._arrays["points"][:, : self._n])

    @property
    def nbytes(self) -> int:
        """Bytes of all copies, without what they share."""
        return sum(array.nbytes for array in self._arrays.values())

    def place(self, copy: int, xyz: Floats) -> bool:
        """Put the control points of one copy at ``xyz (n, 3)``; whether any moved. Call :meth:`compute` afterwards.

        ``ValueError`` for another shape, or a place that is not finite or too far away for 32-bit sums; nothing is
        changed then. ``IndexError`` for another copy than 0 to count - 1.
        """
        if not 0 <= copy < len(self._arrays["points"]):
            raise IndexError(f"copy {copy}: there are {len(self._arrays['points'])}")
        points, most = self._arrays["points"][copy], self._arrays["extent"][copy, 3]
        if xyz.shape != (self._n, 3):
            raise ValueError(f"xyz: shape {xyz.shape}, expected {(self._n, 3)}")
        if np.array_equal(points[: self._n], xyz):
            return False
        if not np.abs(xyz).max() <= most:
            raise ValueError(f"xyz: must be finite and within {most:.3g}")
        points[: self._n * self._copies] = np.tile(xyz, (self._copies, 1))
        self._waiting[copy] = None
        return True

    def compute(self) -> list[int]:
        """Bring the vertices of every copy that was placed up to date; returns which these are."""
        copies, self._waiting = list(self._waiting), {}
        gone = [k for k in copies if measure(self._arrays["points"][k], self._arrays["extent"][k], False)]
        for k in gone:
            self._recentre(k)
        self._compute([k for k in copies if k not in gone])
        return copies

    def _compute(self, copies: list[int]) -> None:
        if copies:
            which = np.array(copies, np.int64)
            compute_copies(self._tables, which, self._cells, self._cuts, self._sign, *self._scratch)

    def _recentre(self, copy: int) -> None:
        """As the source does where its origins do not fit any more."""
        lists, origin = self._source.lists, self._arrays["origin"][copy]
        origin[:] = self._arrays["points"][copy, lists.ids[lists.ids_at]]
        self._compute([copy])
        origin[:] = middles(self.vertices[copy], self._source.mesh.cell_start)
        self._compute([copy])


def slices(sizes: NDArray[np.int64], most: int) -> Ints:
    """Return where to cut a row of things of these ``sizes (c,)`` so that no slice exceeds ``most``, but for single
    things: ``(k + 1,)`` from 0 to c."""
    cuts, total = [0], 0
    for c, size in enumerate(sizes.tolist()):
        if total + size > most and cuts[-1] < c:
            cuts.append(c)
            total = 0
        total += size
    return np.array([*cuts, len(sizes)], np.int64)


def _repeat(array: NDArray[Any], count: int) -> NDArray[Any]:
    """Return (count, ...): copies of an array, with room behind the last: kernels read four numbers of a row of
    three.
    """
    room = np.zeros(count * array.size + LANES, array.dtype)
    room[: count * array.size] = np.tile(array.ravel(), count)
    return room[: count * array.size].reshape(count, *array.shape)


def _read_only(array: Floats | Floats32) -> Any:
    view = array.view()
    view.flags.writeable = False
    return view
