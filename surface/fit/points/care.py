"""Where a face is fitted with more care than elsewhere: lids, whose few millimetres decide whether an eye shuts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Floats
from surface.fit.source.chart import Chart
from surface.fit.source.mesh import FitMesh
from surface.head.model.parameters import smoothstep

CARE = 3.0  # times as much as elsewhere an error counts on a lid
REACH = 1.7, 1.3  # in radii from an eyeball's centre: where skin begins to be a lid, and where it is
POINTS = 160  # more control points for each eye


def with_care(chart: Chart, mesh: FitMesh, eyes: Floats, radius: float) -> Chart:
    """The chart with ``care`` for samples on the lids of ``eyes (k, 3)`` of a radius, mm."""
    at = chart.mix @ mesh.vertices
    care = np.ones(len(at))
    for eye in eyes:
        away = np.linalg.norm(at - eye, axis=1) / radius
        before = at[:, 2] > eye[2]
        care = np.maximum(care, 1.0 + (CARE - 1.0) * smoothstep(away, *REACH) * before)
    return replace(chart, care=care)
