"""The inverse for the picture: points of the skin that somebody drags, or a tracker follows, back to what moves them.

Two ways. :class:`PointSolver` finds the parameters whose face brings the points where they are wanted: bounded least
squares with few values that are not zero. :class:`SculptSolver` moves control points where no parameter fits: the
smallest and fairest displacements that bring the points there exactly, which can be kept as a group file.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from controller.base.errors import ConfigError
from controller.base.files import format_fault, replacing
from controller.base.parameters import Floats, Parameters
from controller.base.solve import BoundedSolver
from controller.robot.anchors import Skin, head_order, sample_skin, shapes_of
from surface.head import Head

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix  # start-up: only reshaping needs it

_RIDGE = 1e-3
_SPARSITY = 0.02
_TOLERANCE = 1e-4
_BENDS = 2
_SETTLED = 0.02
FORMAT = 1


class PointSolver:
    """Solves for parameters that bring points of the skin to wanted places.

    The head's own moves are straight for most parameters; where they bend (jaw, lids) the solve is done again with the
    slopes at the face it found.

    Parameters
    ----------
    head : the head; it is left at rest. uv : (m, 2) points of its part ``part``. parameters : the registry.
    sparsity : prefers few parameters; mm^2 per unit.

    Attributes
    ----------
    skin : the points. moved : (s,) the parameters it solves for.

    Raises
    ------
    ValueError : a point lies where the part has no surface.
    """

    def __init__(self, head: Head, uv: Floats, parameters: Parameters, *, part: str = "face",
                 sparsity: float = _SPARSITY) -> None:  # fmt: skip
        if not head.part(part).surface.covered(uv).all():
            raise ValueError("uv: a point lies where the part has no surface")
        skin = sample_skin(head, part, np.asarray(uv, dtype=np.float64))
        self._set_up(skin, head_order(head.parameters, parameters), parameters, sparsity, np.ones(len(uv)))

    @classmethod
    def of(cls, skin: Skin, order: NDArray[np.intp], parameters: Parameters, *, sparsity: float = _SPARSITY,
           weights: Floats, start: Floats) -> PointSolver:  # fmt: skip
        """A dragger of points that were sampled already.

        Parameters
        ----------
        order : see :func:`controller.robot.anchors.head_order`. weights : (m,) how much each point counts.
        start : (p,) parameters to begin from.
        """
        dragger = object.__new__(cls)
        dragger._set_up(skin, order, parameters, sparsity, weights)
        dragger._last = np.clip(start[dragger.moved], dragger._low, dragger._high)
        return dragger

    def _set_up(self, skin: Skin, order: NDArray[np.intp], parameters: Parameters, sparsity: float,
                weights: Floats) -> None:  # fmt: skip
        self.skin, self._order, self._parameters = skin, order, parameters
        self.moved = order[: skin.moves.shape[2]]
        self._low, self._high = parameters.low[self.moved], parameters.high[self.moved]
        self._sparsity, self._weights = sparsity, np.repeat(weights, 3)
        levels = skin.moves.shape[3]
        # (3 m, s): the slope of each shape on each quarter of its way, and over all of it
        self._slopes = skin.moves.reshape(-1, len(self.moved), levels) * levels
        self._solver = self._make(self._slopes.mean(axis=2))
        self._straight = np.abs(self._slopes - self._slopes[:, :, :1]).max(axis=(0, 2)) < 0.5
        self._last = np.zeros(len(self.moved))

    def _make(self, matrix: Floats) -> BoundedSolver:
        return BoundedSolver(matrix, self._low, self._high, weights=self._weights, ridge=_RIDGE,
                             sparsity=self._sparsity, tolerance=_TOLERANCE)  # fmt: skip

    def solve(self, places: Floats) -> Floats:
        """Parameters (p,) whose face brings the points to ``places`` : (m, 3) mm, head not turned.

        Starts from the last solution, so that it can follow a tracker.

        Raises
        ------
        ValueError : ``places`` has another shape or is not finite.
        """
        if np.shape(places) != self.skin.rest.shape or not np.isfinite(places).all():
            raise ValueError(f"places must be {self.skin.rest.shape} finite numbers")
        wanted = (places - self.skin.rest).ravel()
        x = self._solver.solve(wanted, start=self._last)
        for _ in range(_BENDS):
            if not (x[~self._straight] > 0.0).any():
                break
            before, x = x, self._bent(wanted, x)
            if np.abs(x - before).max() < _SETTLED:
                break
        self._last = x
        values = self._parameters.neutral()
        values[self.moved] = x
        return values

    def _bent(self, wanted: Floats, x: Floats) -> Floats:
        """Solve with the slopes at ``x`` : (s,) of what bends."""
        quarter = np.minimum((x * self._slopes.shape[2]).astype(np.intp), self._slopes.shape[2] - 1)
        matrix = np.take_along_axis(self._slopes, quarter[None, :, None], axis=2)[:, :, 0]
        here = self.skin.displacement(x).ravel() - matrix @ x
        return self._make(matrix).solve(wanted - here, start=x)

    def missing(self, places: Floats, values: Floats) -> Floats:
        """(m, 3) mm between ``places`` and where the face ``values`` : (p,) brings the points."""
        return places - self.skin.rest - self.skin.displacement(shapes_of(values, self._order))


@dataclass(frozen=True)
class Sculpted:
    """Control points of one part that move together: what a head calls a group.

    Attributes
    ----------
    part : the part. ids : (k,) int32 control points. moves : (k, 3) mm per unit.
    """

    part: str
    ids: NDArray[np.int32]
    moves: Floats


class SculptSolver:
    """Finds displacements of control points that bring points of a part exactly where they are wanted.

    Minimises over the displacements D, with L the difference of each control point from the mean of its neighbours,

        fairness |L D|^2 + |D|^2    subject to    B D = wanted,

    B being the rational basis at the points. More fairness spreads a pull wider.

    Parameters
    ----------
    head : the head. part : one of its skin parts. fairness : relative to the size of the moves.
    """

    def __init__(self, head: Head, part: str = "face", *, fairness: float = 10.0) -> None:
        from scipy.sparse import identity  # start-up: only reshaping needs it
        from scipy.sparse.linalg import splu  # start-up: only reshaping needs it

        self.part, self._surface = part, head.part(part).surface
        points = self._surface.points
        bend = _differences(points, next(p.jaw for p in head.data.parts if p.name == part))
        self._factor = splu((fairness * bend.T @ bend + identity(len(points))).tocsc())

    def solve(self, uv: Floats, wanted: Floats, *, least_mm: float = 0.01) -> Sculpted:
        """Control points and displacements that move the points ``uv`` : (m, 2) by ``wanted`` : (m, 3) mm.

        Parameters
        ----------
        least_mm : control points that move less are left out.

        Raises
        ------
        ValueError : a point lies where the part has no surface, two points are one, or numbers are not finite.
        """
        uv, wanted = np.atleast_2d(uv).astype(np.float64), np.atleast_2d(wanted).astype(np.float64)
        if wanted.shape != (len(uv), 3) or not (np.isfinite(wanted).all() and np.isfinite(uv).all()):
            raise ValueError(f"wanted must be ({len(uv)}, 3) finite numbers")
        if not self._surface.covered(uv).all():
            raise ValueError("uv: a point lies where the part has no surface")
        basis = self._surface.basis_matrix(uv)
        spread = self._factor.solve(basis.T.toarray())
        gram = basis @ spread
        if np.linalg.cond(gram) > 1e10:
            raise ValueError("uv: two points are too close to each other")
        moves = spread @ np.linalg.solve(gram, wanted)
        kept = np.flatnonzero(np.linalg.norm(moves, axis=1) >= least_mm).astype(np.int32)
        return Sculpted(self.part, kept, moves[kept])


def _differences(points: Floats, jaw: NDArray[np.floating]) -> csr_matrix:
    """(n, n) sparse: each control point minus the mean of its nearest ones, never across the mouth."""
    from scipy.sparse import coo_matrix, identity  # start-up: only reshaping needs it
    from scipy.spatial import cKDTree  # start-up: only reshaping needs it

    # the lips lie close together but belong to different jaws: set them apart
    apart = np.column_stack([points, 60.0 * np.asarray(jaw, np.float64)])
    _, near = cKDTree(apart).query(apart, k=7)
    n = len(points)
    rows = np.repeat(np.arange(n), 6)
    mean = coo_matrix((np.full(6 * n, 1.0 / 6.0), (rows, near[:, 1:].ravel())), shape=(n, n))
    return (identity(n) - mean).tocsr()


def wear(head: Head, shape: Sculpted, amount: float = 1.0) -> None:
    """Move a head's control points by ``amount`` of a reshape; every pose goes on from there."""
    rig = head.part(shape.part).rig  # type: ignore[attr-defined]
    rig.rest[shape.ids] += amount * shape.moves
    rig.invalidate()


def save_group(path: Path, name: str, shape: Sculpted) -> None:
    """Keep a reshape as a group file, whole or not at all; see docs/expression.md."""
    table = {
        "format": FORMAT,
        "name": name,
        "part": shape.part,
        "ids": shape.ids.tolist(),
        "moves_mm": np.round(shape.moves, 5).tolist(),
    }
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(table) + "\n", encoding="utf-8")


def load_group(path: Path, head: Head) -> tuple[str, Sculpted]:
    """Read a group file for a head; returns its name and content.

    Raises
    ------
    ConfigError : the file cannot be read, is none, or does not fit the head; names file and key.
    """
    try:
        table = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise _bad(path, "file", f"cannot be read ({error})") from error
    fault = format_fault(table.get("format"), FORMAT) if isinstance(table, dict) else "file: must hold a table"
    if fault is not None:
        raise ConfigError(f"{path}: {fault}", hint="bring omote up to date, or make the file again by dragging")
    counts = {part.name: len(part.points) for part in head.data.parts}
    if table.get("part") not in counts:
        raise _bad(path, "part", f"the head has no part {table.get('part')!r}")
    ids, moves = _numbers(path, table, "ids", 1), _numbers(path, table, "moves_mm", 2)
    if moves.shape != (len(ids), 3):
        raise _bad(path, "moves_mm", f"must be {len(ids)} rows of 3")
    if len(ids) and not 0 <= ids.min() <= ids.max() < counts[table["part"]]:
        raise _bad(path, "ids", f"a control point that is not there (0 to {counts[table['part']] - 1})")
    return str(table.get("name", path.stem)), Sculpted(table["part"], ids.astype(np.int32), moves)


def _numbers(path: Path, table: Mapping[str, object], key: str, dimensions: int) -> Floats:
    try:
        found = np.array(table[key], dtype=np.float64)
    except (KeyError, TypeError, ValueError) as error:
        raise _bad(path, key, "missing or not numbers") from error
    if found.ndim != dimensions or not np.isfinite(found).all():
        raise _bad(path, key, "must hold finite numbers")
    return found


def _bad(path: Path, key: str, why: str) -> ConfigError:
    return ConfigError(f"{path}: {key}: {why}", hint="make it again by dragging")
