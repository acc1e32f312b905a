"""A mesh of the shipped head's own parts with some of its shapes, as if another program had made it: a trap in which
what each vertex should do is known."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np

from surface.check.subject import Subject
from surface.fit.source.mesh import FitMesh
from surface.head import Head

ICT = Path(__file__).parents[2] / "configs" / "heads" / "ict"
PIECES = {
    "face": "Head/Skin", "eye_left": "EyeLeft/Eye", "eye_right": "EyeRight/Eye", "teeth_upper": "Teeth/Teeth",
    "teeth_lower": "Teeth/Teeth", "tongue": "Tongue/Tongue", "lashes": "Lashes/Lash",
}  # fmt: skip
OFF_MM = np.array([0.2, -0.15, 0.3])  # the mesh lies not exactly on the head, as after a registration


@cache
def shipped() -> Subject:
    return Subject(Head.load(ICT))


def part_mesh(names: Sequence[str] = (), *, off: np.ndarray = OFF_MM) -> tuple[FitMesh, dict[str, np.ndarray]]:
    """The mesh with the shapes of these names, and the vertices of each part."""
    subject, faces, piece, ids, count = shipped(), [], [], {}, 0
    titles = list(dict.fromkeys(PIECES.values()))
    chosen = [k for k, p in enumerate(subject.parts) if p.name in PIECES]
    for k in chosen:
        part = subject.parts[k]
        own = part.triangles.astype(np.int64) + count
        faces.append(np.column_stack([own, np.full(len(own), -1)]))
        piece.append(np.full(len(own), titles.index(PIECES[part.name])))
        ids[part.name] = np.arange(count, count + len(part.vertices))
        count += len(part.vertices)
    moves = [np.concatenate([subject.moves(name)[k] for k in chosen]) for name in names]
    rest, every = np.concatenate([subject.rest[k] for k in chosen]).astype(float) + off, np.concatenate(faces)
    bare = np.full(every.shape, -1)
    deltas = np.array(moves, float).reshape(len(names), count, 3)
    return FitMesh(rest, every, np.zeros((0, 2)), bare, tuple(names), deltas, np.concatenate(piece), tuple(titles)), ids
