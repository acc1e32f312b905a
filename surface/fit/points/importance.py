"""Give errors on the lids more importance than elsewhere, since few millimetres decide whether an eye closes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.base.arrays import Floats
from surface.fit.source.chart import Chart
from surface.fit.source.mesh import FitMesh
from surface.head.model.parameters import smoothstep

LID_IMPORTANCE = 3.0  # factor by which errors on a lid count more than elsewhere
RISE_RANGE = 1.7, 1.3  # distances from an eyeball's centre, in its radii, between which the importance rises
POINTS_PER_EYE = 160  # additional control points for each eye


def with_importance(chart: Chart, mesh: FitMesh, eyes: Floats, radius: float) -> Chart:
    """The chart with the ``importance`` of its samples; ``eyes (k, 3)`` are centres of eyeballs, mm, of one radius."""
    at = chart.mix @ mesh.vertices
    importance = np.ones(len(at))
    for eye in eyes:
        away = np.linalg.norm(at - eye, axis=1) / radius
        before = at[:, 2] > eye[2]
        importance = np.maximum(importance, 1.0 + (LID_IMPORTANCE - 1.0) * smoothstep(away, *RISE_RANGE) * before)
    return replace(chart, importance=importance)
