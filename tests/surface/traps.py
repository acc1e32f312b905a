"""One good head as a mesh, made here, and what strangers do to it: moved, scaled, turned, on a body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.fit.source.load import Loaded, _turned
from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import map_names
from surface.fit.source.placing.frame import EYES_AT, find_frame
from surface.fit.source.placing.place import place

EYE_X, EYE_RADIUS = 31.8, 12.1
HALF = np.array([[EYE_X, 0.0, 0.0], [-EYE_X, 0.0, 0.0]])


def grid(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(u, v) each (rows * columns,) in 0..1 and faces (f, 4), anticlockwise seen with u right and v up."""
    v, u = (x.ravel() for x in np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij"))
    at = np.arange(rows * columns).reshape(rows, columns)
    return u, v, np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1).reshape(-1, 4)


def _skin() -> FitMesh:
    """A skull with a nose on a neck, y from -190 to 145 mm, in the place of the shipped head."""
    u, v, faces = grid(60, 48)
    y = -190.0 + 335.0 * v
    # half width and half depth of the cross-sections: shoulders, neck, jaw, cheeks, crown
    at = [-190, -150, -110, -75, -40, 40, 100, 135, 145]
    wide = np.interp(y, at, [118, 110, 62, 60, 72, 82, 74, 40, 4])
    deep = np.interp(y, at, [70, 70, 62, 66, 88, 92, 84, 46, 4])
    angle = 2.0 * np.pi * (u - 0.5)
    x, z = wide * np.sin(angle), deep * np.cos(angle) + 8.0
    nose = 26.0 * np.exp(-((x / 12.0) ** 2) - ((y + 2.0) / 20.0) ** 2) * (z > 0)
    return FitMesh(
        np.column_stack([x, y, z + nose]),
        faces,
        np.column_stack([u, v]),
        faces.copy(),
        (),
        np.zeros((0, len(u), 3)),
        np.zeros(len(faces), np.int64),
        ("Head",),
    )


def _bump(points: np.ndarray, at: np.ndarray, reach: float) -> np.ndarray:
    return np.exp(-(((points - at) / reach) ** 2).sum(axis=1))


def _ball(side: int) -> FitMesh:
    u, v, faces = grid(13, 17)
    a, b = np.pi * (v - 0.5), 2.0 * np.pi * u
    points = np.column_stack([np.cos(a) * np.sin(b), np.sin(a), np.cos(a) * np.cos(b)])
    return FitMesh(
        EYE_RADIUS * points + EYES_AT + HALF[side],
        faces,
        np.column_stack([u, v]),
        faces.copy(),
        (),
        np.zeros((0, len(u), 3)),
        np.zeros(len(faces), np.int64),
        (f"Eye{'LR'[side]}",),
    )


def joined(*meshes: FitMesh) -> FitMesh:
    """Several meshes as one, with the shapes of the first; their objects stay apart."""
    first, total = meshes[0], sum(len(m.vertices) for m in meshes)
    deltas = np.zeros((len(first.names), total, 3))
    deltas[:, : len(first.vertices)] = first.deltas
    starts = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    textures = np.cumsum([0, *(len(m.uv) for m in meshes)])
    objects = np.cumsum([0, *(len(m.pieces) for m in meshes)])

    def shifted(index: np.ndarray, by: int) -> np.ndarray:
        return np.where(index >= 0, index + by, -1)

    return FitMesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([shifted(m.faces, s) for m, s in zip(meshes, starts, strict=False)]),
        np.concatenate([m.uv for m in meshes]),
        np.concatenate([shifted(m.face_uv, s) for m, s in zip(meshes, textures, strict=False)]),
        first.names,
        deltas,
        np.concatenate([m.piece + s for m, s in zip(meshes, objects, strict=False)]),
        tuple(n for m in meshes for n in m.pieces),
    )


def good_head(*, eyeballs: bool = True) -> FitMesh:
    """The head in mm, y up, z forward, with shapes of lids, lips and jaw."""
    skin = _skin()
    p = skin.vertices
    front = (p[:, 2] > 20.0).astype(float)
    moves = {}
    for name, k in (("eyeBlinkLeft", 0), ("eyeBlinkRight", 1)):
        lid = EYES_AT + HALF[k] + [0.0, 4.6, 10.4]
        moves[name] = np.outer(_bump(p, lid, 9.0) * front, [0.0, -6.0, 1.0])
    lips = np.array([0.0, -36.0, 98.0])
    moves["mouthPucker"] = np.outer(_bump(p, lips, 14.0) * front, [0.0, 0.0, 6.0])
    moves["jawOpen"] = np.outer(_bump(p, np.array([0.0, -48.0, 92.0]), 26.0) * front, [0.0, -14.0, -3.0])
    skin = replace(skin, names=tuple(moves), deltas=np.stack(list(moves.values())))
    return joined(skin, _ball(0), _ball(1)) if eyeballs else skin


def transformed(mesh: FitMesh, turn: np.ndarray, scale: float = 1.0, shift: tuple[float, float, float] = (0, 0, 0)):
    """The mesh as a file would have it whose axes stand so: ``turn`` rows are the head's left, up and forward."""
    return replace(mesh, vertices=scale * (mesh.vertices @ turn) + np.array(shift), deltas=scale * (mesh.deltas @ turn))


def _tube(low: tuple[float, float, float], high: tuple[float, float, float], radius: float, name: str) -> FitMesh:
    """A closed-looking tube between two points, as bodies are made of here."""
    u, v, faces = grid(9, 13)
    axis = np.array(high) - low
    across = np.cross(axis, [0.3, 0.2, 0.93])
    across /= np.linalg.norm(across)
    other = np.cross(axis / np.linalg.norm(axis), across)
    angle = 2.0 * np.pi * u
    points = (
        np.array(low) + np.outer(v, axis) + radius * (np.outer(np.cos(angle), across) + np.outer(np.sin(angle), other))
    )
    return FitMesh(
        points, faces, np.column_stack([u, v]), faces.copy(), (), np.zeros((0, len(u), 3)),
        np.zeros(len(faces), np.int64), (name,),
    )  # fmt: skip


def on_body(head: FitMesh) -> FitMesh:
    """The head on a body 1.7 m tall, in trousers and boots, arms stretched out, feet at the origin."""
    trunk = _tube((0, -190, -10), (0, -820, -10), 140, "Body")
    arms = [_tube((s * 120, -180, -10), (s * 700, -180, -10), 45, f"Arm{s}") for s in (1, -1)]
    legs = [_tube((s * 80, -760, -10), (s * 80, -1500, -10), 80, "Trousers") for s in (1, -1)]
    boots = [_tube((s * 80, -1540, -40), (s * 80, -1540, 160), 50, "Boots") for s in (1, -1)]
    whole = joined(head, trunk, *arms, *legs, *boots)
    return replace(whole, vertices=whole.vertices - [0.0, whole.vertices[:, 1].min(), 0.0])


def placed(mesh: FitMesh, **options) -> Loaded:
    """The mesh as a fit places it; options as of a frame."""
    shapes = dict(zip(mesh.names, mesh.deltas, strict=True))
    frame = find_frame(mesh.vertices, shapes, faces=mesh.faces, **options)
    turned = replace(mesh, vertices=frame.points(mesh.vertices), deltas=frame.points(mesh.deltas))
    return place(Loaded(turned, map_names(mesh.names), frame.notes, frame.placement, _turned(frame)))
