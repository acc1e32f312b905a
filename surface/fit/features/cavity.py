"""Determine which islands of a face line its mouth. They become a separate part: surfaces that nobody sees from outside
need none of the face's control points, and have the colour of a mouth.
"""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Bools, Ints
from surface.fit.source.islands import Island
from surface.fit.source.mesh import FitMesh, face_areas
from surface.fit.source.owncharts import faces_of
from surface.fit.source.regions import sight

NAME, MATERIAL = "cavity", "mouth"  # the part; contacts take it along with the lips
POINTS, COARSE, ERROR_MM = 600, 0.1, 0.4  # its control points and the error that counts as 1, of a usual head
SPARE = 180  # more of them, where it is far off: a bag opens from a small hole in (u, v), and an open jaw stretches it
CHORD_MM = 0.25  # of its triangles, of a usual head: what is seen of it between parted lips is its edge there
STILL, MOVED = 0.3, 0.5  # of the chin's way when the jaw opens: a lining holds what moves less, and what moves more
SEEN = 0.12  # share of all directions in front of a face: what is seen from fewer lies inside
INSIDE = 0.7  # of its area lies inside
NONE = np.zeros(0, np.int64)


def line_mouth(mesh: FitMesh, islands: list[Island], faces: Ints, others: Ints) -> list[bool]:
    """Whether each island of the skin's ``faces (f,)`` lines the mouth.

    A lining spans from the upper lip, which the jaw leaves where it is, to the lower one, and is hidden by the rest; so
    are further pieces that hang together with one. Without jawOpen none is known.
    others : (g,) faces of what stands before the skin, as eyeballs do.
    """
    spans = [_spans_jaw(mesh, island) for island in islands]
    if not any(spans) or len(islands) < 2:
        return [False] * len(islands)
    hidden = [_is_hidden(mesh, faces_of(mesh, faces, island), faces, others) for island in islands]
    return _with_neighbours(islands, [a and b for a, b in zip(spans, hidden, strict=True)], hidden)


def _with_neighbours(islands: list[Island], chosen: list[bool], others: list[bool]) -> list[bool]:
    """What is chosen, and those of the others that share vertices with it, directly or through each other."""
    while True:
        near = np.unique(np.concatenate([NONE, *(i.vertex for i, x in zip(islands, chosen, strict=True) if x)]))
        touching = [bool(np.isin(i.vertex, near).any()) for i in islands]
        more = [x or (o and t) for x, o, t in zip(chosen, others, touching, strict=True)]
        if more == chosen:
            return chosen
        chosen = more


def _spans_jaw(mesh: FitMesh, island: Island) -> bool:
    """Does the island reach from what an opening jaw leaves behind to what it takes along?"""
    if "jawOpen" not in mesh.names:
        return False
    moved = np.linalg.norm(mesh.deltas[mesh.names.index("jawOpen")], axis=1)
    own, most = moved[island.vertex], float(moved.max())
    return bool(own.min() < STILL * most and own.max() > MOVED * most)


def _is_hidden(mesh: FitMesh, own: Ints, faces: Ints, others: Ints) -> bool:
    """Is most of the area of ``own`` faces behind the rest of the skin, from wherever it is looked at?"""
    if not len(own):
        return False
    seen = sight(mesh, own, np.concatenate([np.setdiff1d(faces, own), others]))
    area = face_areas(mesh.vertices, mesh.faces[own])
    inside: Bools = seen < SEEN
    return float(area[inside].sum()) > INSIDE * float(area.sum())
