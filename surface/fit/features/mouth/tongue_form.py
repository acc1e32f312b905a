"""Give a fitted tongue a round back with a shallow groove.

Modelled at the palate, its back is pressed flat, with a deep furrow between two humps; seen from the front of an open
mouth that looks like a flat heart.
"""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats
from surface.dcp import DCPSurface

SAMPLES = 61, 101  # along the tongue and around it
SLICE_MM = 3.0  # half the length of a slice in which its form is measured
SLICES = 25
HUMP = 0.25, 0.55  # in half widths of the tongue: where beside its middle the humps lie
FURROW = 0.32  # in half widths: how wide the furrow is that is filled
GROOVE_MM, GROOVE_WIDE = 0.7, 0.12  # what is left of it, and how wide that is in half widths
EDGE = 0.22  # of its half width: how much lower than its middle the edges of its back lie
KEPT = 0.3  # weight with which control points go where the space around them goes, beside a sample's


def rounded_tongue(points: Floats, surface: DCPSurface, rect: tuple[float, float, float, float]) -> Floats:
    """Return the control points (n, 3), mm, of a tongue whose back is rounded across; its length and width stay.

    points : (n, 3) of the tongue at rest. surface : with these points. rect : (u0, u1, v0, v1) that it covers. Front is
    +z, up is y, and x is 0 in its middle.
    """
    u0, u1, v0, v1 = rect
    uv = np.stack(np.meshgrid(np.linspace(u0, u1, SAMPLES[0]), np.linspace(v0, v1, SAMPLES[1])), axis=-1).reshape(-1, 2)
    at = surface.evaluate(uv)
    uv, at = uv[np.isfinite(at).all(axis=1)], at[np.isfinite(at).all(axis=1)]
    form = _Form(at)
    basis = surface.basis_matrix(uv).toarray()
    system = np.vstack([basis, KEPT * np.eye(len(points))])
    wanted = np.vstack([form.rise(at), KEPT * form.rise(points)])
    moved: Floats = points + np.linalg.lstsq(system, wanted, rcond=None)[0]
    return moved


class _Form:
    """Where a tongue's back lies, from samples (m, 3) of it."""

    def __init__(self, at: Floats) -> None:
        self._z = np.linspace(at[:, 2].min() + SLICE_MM, at[:, 2].max() - 0.5 * SLICE_MM, SLICES)
        rows = np.array([_measured(at[np.abs(at[:, 2] - z) < SLICE_MM]) for z in self._z])
        smooth = np.array([0.25, 0.5, 0.25])
        self._rows = np.column_stack([np.convolve(np.pad(row, 1, mode="edge"), smooth, mode="valid") for row in rows.T])

    def rise(self, at: Floats) -> Floats:
        """(k, 3) by how much places (k, 3) of the tongue go up, mm."""
        half, middle, top, furrow = (np.interp(at[:, 2], self._z, row) for row in self._rows.T)
        aside = np.abs(at[:, 0]) / half
        over = np.clip((at[:, 1] - middle) / np.maximum(top - middle, 1e-6), 0.0, 1.0)
        fill = furrow * np.exp(-((aside / FURROW) ** 2)) - GROOVE_MM * np.exp(-((aside / GROOVE_WIDE) ** 2))
        up = over * (3.0 - 2.0 * over) * over * (fill - EDGE * half * np.clip(aside, 0.0, 1.0) ** 2.5)
        return np.column_stack([np.zeros(len(at)), up, np.zeros(len(at))])


def _measured(at: Floats) -> tuple[float, float, float, float]:
    """Half width of a slice (k, 3) of a tongue, the y of its middle and of its top, and how deep its furrow is, mm."""
    half = float(np.abs(at[:, 0]).max())
    middle = 0.5 * float(at[:, 1].min() + at[:, 1].max())
    aside, upper = np.abs(at[:, 0]) / half, at[:, 1] > middle
    hump = at[upper & (aside > HUMP[0]) & (aside < HUMP[1]), 1]
    furrow = at[upper & (aside < 0.5 * GROOVE_WIDE), 1]
    top = float(hump.max()) if len(hump) else float(at[:, 1].max())
    deep = max(top - float(furrow.max()), 0.0) if len(furrow) else 0.0
    return half, middle, top, deep
