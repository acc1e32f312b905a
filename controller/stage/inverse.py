"""Solves for parameters or control points that move dragged or tracked points of the skin to wanted positions.

:class:`PointSolver` finds parameters by sparse, bounded least squares. :class:`SculptSolver` moves control points where
no parameter fits: it finds the smallest and smoothest displacements that bring the points to their positions exactly,
which can be saved as a group file.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from controller.base.config import Settings, check, config_error
from controller.base.errors import ConfigError
from controller.base.files import format_fault, replacing
from controller.base.parameters import Floats, Parameters
from controller.base.solve import BoundedSolver
from controller.robot.anchors import SkinSamples
from controller.robot.terms import Finite
from surface.base import files
from surface.base.extras import require
from surface.head import Head
from surface.head.model.data import HeadData
from surface.head.model.light import LightPoints, join_light

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix  # imported lazily: only sculpting needs it

_RIDGE = 1e-3
_SPARSITY = 0.02
_TOLERANCE = 1e-4
_LINEAR_MM = 0.5  # a shape whose slopes differ by less is treated as linear
_MAX_RESOLVES = 2  # repeated solves for shapes that are not linear
_CONVERGED = 0.02  # change of parameters below which the solve is not repeated
_MAX_BYTES = 4 << 20
FORMAT = 1
"""Version of the group files that :func:`save_group` writes."""


class PointSolver:
    """Solves for parameters that bring points of the skin to wanted positions.

    Most shapes move the skin along straight lines. If one that does not (jaw, lids) is used, the solve is repeated with
    the slopes at the solution.

    skin : m points. order : see :func:`controller.robot.anchors.head_order`. parameters : all of them, p.
    sparsity : penalty that prefers few parameters, mm^2 per unit. weights : (m,) of the points. Default: 1.
    start : (p,) initial parameters. Default: neutral.
    """

    def __init__(
        self, skin: SkinSamples, order: NDArray[np.intp], parameters: Parameters, *,
        sparsity: float = _SPARSITY, weights: Floats | None = None, start: Floats | None = None,
    ) -> None:  # fmt: skip
        self.skin, self._parameters = skin, parameters
        count, levels = skin.moves.shape[2:]
        self.moved = order[:count]  # the parameters to solve for
        self._low, self._high = parameters.low[self.moved], parameters.high[self.moved]
        self._sparsity = sparsity
        self._weights = np.repeat(np.ones(len(skin.rest)) if weights is None else weights, 3)
        # (3 m, s, levels): the slope of each shape on each section of its range
        self._slopes = skin.moves.reshape(-1, count, levels) * levels
        self._solver = self._make_solver(self._slopes.mean(axis=2))
        self._linear = np.abs(self._slopes - self._slopes[:, :, :1]).max(axis=(0, 2)) < _LINEAR_MM
        start = parameters.neutral() if start is None else start
        self._last = np.clip(start[self.moved], self._low, self._high)

    def _make_solver(self, matrix: Floats) -> BoundedSolver:
        return BoundedSolver(matrix, self._low, self._high, weights=self._weights, ridge=_RIDGE,
                             sparsity=self._sparsity, tolerance=_TOLERANCE)  # fmt: skip

    def solve(self, places: Floats) -> Floats:
        """Return parameters (p,) whose face brings the points to ``places`` : (m, 3) mm, of a head that is not turned.

        Starts from the last solution, so that it can follow a tracker. Raises ValueError: ``places`` has another shape
        or is not finite.
        """
        if np.shape(places) != self.skin.rest.shape or not np.isfinite(places).all():
            raise ValueError(f"places must be {self.skin.rest.shape} finite numbers")
        wanted = (places - self.skin.rest).ravel()
        x = self._solver.solve(wanted, start=self._last)
        for _ in range(_MAX_RESOLVES):
            if not (x[~self._linear] > 0.0).any():
                break
            before, x = x, self._solve_at(wanted, x)
            if np.abs(x - before).max() < _CONVERGED:
                break
        self._last = x
        values = self._parameters.neutral()
        values[self.moved] = x
        return values

    def _solve_at(self, wanted: Floats, x: Floats) -> Floats:
        """Solve with the slopes at ``x`` : (s,)."""
        levels = self._slopes.shape[2]
        section = np.minimum((x * levels).astype(np.intp), levels - 1)
        matrix = np.take_along_axis(self._slopes, section[None, :, None], axis=2)[:, :, 0]
        offset = self.skin.displacement(x).ravel() - matrix @ x
        return self._make_solver(matrix).solve(wanted - offset, start=x)


@dataclass(frozen=True)
class GroupMoves:
    """A group: control points of one part of a head that move together.

    part : name of the part. ids : (k,) int32 control points. moves : (k, 3) mm per unit.
    light : control points that the group adds to the part, see :mod:`surface.head.model.light`; None if it adds none.
    light_moves : (j, 3) mm per unit of the added control points.
    """

    part: str
    ids: NDArray[np.int32]
    moves: Floats
    light: LightPoints | None = None
    light_moves: Floats = field(default_factory=lambda: np.zeros((0, 3)))


class SculptSolver:
    """Finds displacements of control points that bring points of a part exactly to wanted positions.

    Minimises over the displacements D, with L the difference of each control point from the mean of its neighbours,

        fairness |L D|^2 + |D|^2    subject to    B D = wanted,

    B being the rational basis at the points. More fairness spreads a pull wider.

    part : name of a skin part of ``head``. fairness : weight of smoothness relative to the size of the displacements.
    """

    def __init__(self, head: Head, part: str = "face", *, fairness: float = 10.0) -> None:
        require("moving control points by hand", "scipy")
        from scipy.sparse import identity  # imported lazily: only sculpting needs it
        from scipy.sparse.linalg import splu  # imported lazily: only sculpting needs it

        self.part, self._surface = part, head.part(part).surface
        points = self._surface.points
        smoothness = _differences(points, next(p.jaw for p in head.data.parts if p.name == part))
        self._factor = splu((fairness * smoothness.T @ smoothness + identity(len(points))).tocsc())

    def solve(self, uv: Floats, wanted: Floats, *, least_mm: float = 0.01) -> GroupMoves:
        """Return the control points and displacements that move the points ``uv`` : (m, 2) by ``wanted`` : (m, 3) mm.

        Control points that move less than ``least_mm`` are omitted. Raises ValueError: a point lies where the part has
        no surface, two points coincide, or numbers are not finite.
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
        return GroupMoves(self.part, kept, moves[kept])


def _differences(points: Floats, jaw: NDArray[np.floating]) -> csr_matrix:
    """Return (n, n) sparse: each control point minus the mean of its six neighbours, never across the mouth."""
    from scipy.sparse import coo_matrix, identity  # imported lazily: only sculpting needs it
    from scipy.spatial import cKDTree  # imported lazily: only sculpting needs it

    # the lips are close together but move with different jaws, so a fourth coordinate separates them
    separated = np.column_stack([points, 60.0 * np.asarray(jaw, np.float64)])
    _, near = cKDTree(separated).query(separated, k=7)
    n = len(points)
    rows = np.repeat(np.arange(n), 6)
    mean = coo_matrix((np.full(6 * n, 1.0 / 6.0), (rows, near[:, 1:].ravel())), shape=(n, n))
    return (identity(n) - mean).tocsr()


def add_group(head: Head, group: GroupMoves, amount: float = 1.0) -> None:
    """Move a head's control points at rest by ``amount`` of a group; modifies ``head``, and all its later poses."""
    rig = head.part(group.part).rig  # type: ignore[attr-defined]
    rig.rest[group.ids] += amount * group.moves
    rig.invalidate()


class LightPoint(Settings, extra="ignore"):
    """A control point that a group adds: its knots in u and v, and its displacement."""

    u: tuple[Finite, Finite, Finite, Finite, Finite]
    v: tuple[Finite, Finite, Finite, Finite, Finite]
    move_mm: tuple[Finite, Finite, Finite]


class GroupFile(Settings, extra="ignore"):
    """The contents of a group file: control points of a part with their displacements, and control points to add."""

    name: str = ""
    part: str
    ids: list[Annotated[int, Field(ge=0)]]
    moves_mm: list[tuple[Finite, Finite, Finite]]
    light: list[LightPoint] = []


def save_group(path: Path, name: str, group: GroupMoves) -> None:
    """Write a group file atomically; see docs/expression.md."""
    table: dict[str, object] = {
        "format": FORMAT,
        "name": name,
        "part": group.part,
        "ids": group.ids.tolist(),
        "moves_mm": np.round(group.moves, 5).tolist(),
    }
    if group.light is not None:
        rows = zip(group.light.knots_u.tolist(), group.light.knots_v.tolist(), group.light_moves.tolist(), strict=True)
        table["light"] = [{"u": u, "v": v, "move_mm": [round(x, 3) for x in move]} for u, v, move in rows]
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(table) + "\n", encoding="utf-8")


def load_group(path: Path, head: HeadData) -> tuple[str, GroupMoves]:
    """Read a group file for a head to which no group has added control points; return its name and content.

    Raises ConfigError: the file cannot be read, is not a group file, or does not fit the head; lists every fault.
    """
    return read_group(path, {part.name: len(part.points) for part in head.parts})


def read_group(path: Path, counts: Mapping[str, int] | None = None) -> tuple[str, GroupMoves]:
    """Read a group file; return its name and content.

    counts : numbers of control points by part, of the head that the group must fit. Default: any head.

    Raises ConfigError as :func:`load_group`.
    """

    def misfits(group: GroupFile) -> list[str]:
        faults = []
        if len(group.moves_mm) != len(group.ids):
            faults.append(f"moves_mm: must be {len(group.ids)} rows of 3")
        if any(b <= a for each in group.light for k in (each.u, each.v) for a, b in pairwise(k)):
            faults.append("light: knots must ascend")
        if counts is not None and group.part not in counts:
            return [f"part: the head has no part {group.part!r}"]
        if counts is not None and max(group.ids, default=0) >= counts[group.part]:
            faults.append(f"ids: an unknown control point (0 to {counts[group.part] - 1})")
        return faults

    with files.reading(path, ConfigError, hint="make it again, or take it from a copy"):
        table = files.read_json(path, _MAX_BYTES)
    fault = format_fault(table.get("format"), FORMAT) if isinstance(table, dict) else "file: must hold a table"
    if fault is not None:
        raise config_error(path, [fault])
    group = check(table, GroupFile, path, misfits)
    moves = np.array(group.moves_mm, dtype=np.float64).reshape(-1, 3)
    found = GroupMoves(group.part, np.array(group.ids, dtype=np.int32), moves)
    if group.light:
        u, v, added = (np.array([getattr(each, key) for each in group.light]) for key in ("u", "v", "move_mm"))
        found = replace(found, light=LightPoints(group.part, u, v), light_moves=added)
    return group.name or path.stem, found


def light_of(groups: Sequence[GroupMoves]) -> list[LightPoints]:
    """Return the control points that groups add to a head, in the order of the groups."""
    return [group.light for group in groups if group.light is not None]


def placed_groups(groups: Sequence[GroupMoves], head: HeadData, more: Sequence[LightPoints] = ()) -> list[GroupMoves]:
    """Return groups whose added control points have the ids that they got in ``head``.

    The head was loaded with ``light_of(groups)`` followed by ``more``.
    """
    added = {name: len(points) for name, points in join_light([*light_of(groups), *more]).items()}
    first = {part.name: len(part.points) - added.get(part.name, 0) for part in head.parts}
    out = []
    for group in groups:
        count = len(group.light_moves)
        ids = first.get(group.part, 0) + np.arange(count, dtype=np.int32)
        if count:
            first[group.part] += count
        moves = np.concatenate([group.moves, group.light_moves])
        out.append(GroupMoves(group.part, np.concatenate([group.ids, ids]).astype(np.int32), moves))
    return out
