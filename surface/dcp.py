"""Discretized control point surfaces, Eq. (1): S = sum b_i w_i P_i / sum b_i w_i.

Every control point has its own position, weight and two knot vectors; b_i is the product of its blending
function in u and its blending function in v. There is no grid (Hosaka, Sugimoto, Nishi and Kato, "Facial
expression for a CG robot using real-time surface modification", Eq. 1).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike

from surface.base.arrays import Floats
from surface.base.checks import check_inside, check_uv
from surface.base.progress import Progress, no_progress
from surface.mesh.domain import Domain
from surface.mesh.mesh import Mesh
from surface.spline.controlpoints import ControlPoints
from surface.spline.matrix import Rows, basis_matrices, basis_rows
from surface.spline.nurbs import nurbs_arrays
from surface.spline.refine import Refinement, insert_knot, refine

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from surface.deform.deformation import Deformation


class DCPSurface(ControlPoints):
    """A surface of scattered control points; immutable.

    See :class:`surface.spline.controlpoints.ControlPoints` for the arguments and errors.

    Blending functions are right-continuous as in NURBS. Where that leaves (u, v) uncovered, the limits from
    the left are tried (first in u, then v, then both), which includes the right end of a clamped domain.
    """

    @classmethod
    def from_nurbs(
        cls,
        degree_u: int,
        degree_v: int,
        knots_u: ArrayLike,
        knots_v: ArrayLike,
        control_points: ArrayLike,
        weights: ArrayLike | None = None,
    ) -> Self:
        """Return the same surface as a NURBS surface; arguments and errors as
        :func:`surface.spline.nurbs.nurbs_arrays`.

        Point (i, j) of the net becomes control point ``i * nv + j``.
        """
        return cls(*nurbs_arrays(degree_u, degree_v, knots_u, knots_v, control_points, weights))

    def evaluate(self, uv: ArrayLike, side: ArrayLike | None = None) -> Floats:
        """Return points (m, 3) float64 of the surface at ``uv (m, 2)``, NaN rows where nothing covers (u, v).

        ``side (m,)`` int: 1 takes the limit from the left in u, 2 in v, 3 in both.

        ``ValueError`` for another shape, numbers that are not finite, a place outside :attr:`rect` (a closed direction
        has no outside), or another side; names the argument and the index.
        """
        return self.sample(self._inside(uv), side)[2]

    def covered(self, uv: ArrayLike) -> np.ndarray:
        """Return which of ``uv (m, 2)`` any control point covers, (m,) bool; False outside :attr:`rect`, too."""
        return self.sample(uv, None)[1] >= 0

    def derivatives(self, uv: ArrayLike, side: ArrayLike | None = None) -> tuple[Floats, Floats, Floats]:
        """Return S, S_u and S_v, each (m, 3) float64, NaN rows where nothing covers; arguments as :meth:`evaluate`."""
        out = self.sample_derivatives(self._inside(uv), side)[1]
        return out[:, 0].copy(), out[:, 1].copy(), out[:, 2].copy()

    def second_derivatives(self, uv: ArrayLike, side: ArrayLike | None = None) -> tuple[Floats, Floats, Floats]:
        """Return S_uu, S_uv and S_vv, each (m, 3) float64, NaN rows where nothing covers; arguments as
        :meth:`evaluate`."""
        out = self.sample_derivatives(self._inside(uv), side, second=True)[1]
        return out[:, 3].copy(), out[:, 4].copy(), out[:, 5].copy()

    def curvatures(self, uv: ArrayLike, side: ArrayLike | None = None) -> tuple[Floats, Floats]:
        """Return Gaussian and mean curvature, (m,) float64 each, per length squared and per length.

        Arguments are as for :meth:`evaluate`. The mean one is positive where the surface bends towards S_u x S_v. Both
        are NaN where nothing covers or S_u x S_v vanishes (do Carmo, Differential Geometry of Curves and Surfaces 3-3).
        """
        su, sv, suu, suv, svv = self.sample_derivatives(self._inside(uv), side, second=True)[1].transpose(1, 0, 2)[1:]
        normal = np.cross(su, sv)
        area = np.linalg.norm(normal, axis=1)
        area[area == 0] = np.nan
        normal /= area[:, None]
        first = [(a * b).sum(axis=1) for a, b in ((su, su), (su, sv), (sv, sv))]
        second = [(a * normal).sum(axis=1) for a in (suu, suv, svv)]
        gaussian = (second[0] * second[2] - second[1] ** 2) / area**2
        mean = (second[0] * first[2] - 2 * second[1] * first[1] + second[2] * first[0]) / (2 * area**2)
        return gaussian, mean

    def insert_knot(self, axis: str, value: float, ids: ArrayLike | None = None) -> Refinement[Self]:
        """Return the same surface with one more knot at ``value`` along ``axis`` ("u" or "v"), exactly.

        Only points ``ids`` are split (all if left out), and of these those whose subdomain holds it inside. Returns the
        new surface, and how data of the old points is carried over.
        """
        return insert_knot(self, axis, value, ids)

    def refine(self, region: tuple[float, float, float, float]) -> Refinement[Self]:
        """Return the same surface with half as wide control points where ``region`` (u0, u1, v0, v1) is, exactly.

        Points whose subdomain does not reach the region stay as they are.
        """
        return refine(self, region)

    def basis_matrix(
        self, uv: ArrayLike, derivative: tuple[int, int] = (0, 0), side: ArrayLike | None = None
    ) -> csr_matrix:
        """Return rational weights, (m, n) float64: ``basis_matrix(uv) @ points`` is ``evaluate(uv)``.

        ``derivative`` is (0, 0), (1, 0) for S_u or (0, 1) for S_v. Rows where nothing covers are empty.
        """
        return basis_matrices(self, self._inside(uv), [derivative], side)[0]

    def basis_rows(self, uv: ArrayLike) -> Rows:
        """Return rational weights for products with few columns, without scipy: ``basis_rows(uv) @ points`` is
        ``evaluate(uv)``."""
        return basis_rows(self, self._inside(uv))

    def tessellate(
        self,
        *,
        max_points: int | None = None,
        chord_error: float | None = None,
        max_depth: int = 9,
        min_depth: int = 0,
        domain: Domain | None = None,
        loop_error: float | None = None,
        roots: tuple[int, int] | None = None,
        flip: bool = False,
        measured: bool = True,
        progress: Progress = no_progress,
    ) -> Mesh:
        """Return a watertight mesh by quad tree (paper, 2.3).

        max_points : quarter cells until at most so many control points reach each
        chord_error : quarter cells until the surface is this near to their triangles, in units of the points;
            if neither limit is given, a thousandth of the size of the control net. The distance is measured at 25
            samples a cell, and on creases in it, and holds between them by a margin; it may be exceeded where
            ``max_depth`` ends, and in the triangles that a loop cuts
        max_depth, min_depth : levels below the roots, at most 20
        domain : where to draw; the rectangle of all subdomains if left out
        loop_error : how near the mesh's border follows the loops; ``chord_error`` if left out
        roots : cells along u and v before any quartering; chosen roughly square if left out
        measured : False estimates the distance from nine samples a cell, in a quarter of the time; the surface may then
            be up to twice ``chord_error`` away
        flip : reverse normals and triangles against S_u x S_v
        progress : is called with the name of a stage and the part of the whole that is done, 0 to 1

        ``ValueError`` for limits out of range, or where they need millions of cells.
        """
        from surface.mesh.splitting import Limits  # compiled: loaded when first used
        from surface.mesh.tessellate import tessellate

        limits = Limits(max_points, chord_error, max_depth, min_depth, loop_error, roots, measured)
        return tessellate(self, Domain.of(self) if domain is None else domain, limits, flip, progress)

    def deformation(
        self, mesh: Mesh, *, normals: bool = True, threads: int = 1, progress: Progress = no_progress
    ) -> Deformation[Self]:
        """Return a mesh from :meth:`tessellate` that follows moves of control points, changes of weights and of knots
        (Eq. 2).

        See :class:`surface.deform.deformation.Deformation` for the arguments.
        """
        from surface.deform.deformation import Deformation  # compiled: loaded when first used

        return Deformation(self, mesh, normals=normals, threads=threads, progress=progress)

    def _inside(self, uv: ArrayLike) -> Floats:
        return check_inside(check_uv(uv), self.rect, self._closed)
