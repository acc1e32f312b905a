"""A plain face made here, with lids that lie on eyeballs and blink over them, and eyes of every kind to put into it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from surface.fit.source.islands import Island, boundary_loops
from surface.fit.source.mesh import FitMesh

CENTRES, RADIUS = np.array([[32.0, 40.0, 40.0], [-32.0, 40.0, 40.0]]), 12.0
COLUMNS, ROWS = 65, 85
HALF_WIDTH, HALF_HEIGHT = 13.0, 5.5  # of the opening between lids, mm
ABOVE = 0.6  # of the lids above the eyeball, mm
SIZE = np.array([180.0, 220.0])


def face(*, lids: bool = True, shapes: bool = True) -> FitMesh:
    """A bulging sheet with two almond-shaped holes, eyeBlinkLeft, eyeBlinkRight and jawOpen; ``lids=False`` : without
    holes, ``shapes=False`` : without shapes."""
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-0.5, 0.5, COLUMNS) * SIZE[0],
                                           40.0 + np.linspace(-0.7, 0.3, ROWS) * SIZE[1], indexing="ij"))  # fmt: skip
    row = int(np.argmin(np.abs(np.linspace(-0.7, 0.3, ROWS) + 0.5 / ROWS)))  # the lower lid's; the next is the upper's
    rest, shut = (_placed(x, y, row, openness) for openness in (1.0, 0.0))
    at = np.arange(COLUMNS * ROWS).reshape(COLUMNS, ROWS)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(COLUMNS - 1), np.arange(ROWS - 1), indexing="ij"))
    middle = 0.5 * (x[at[i, j]] + x[at[i + 1, j]])
    hole = (j == row) & (np.abs(np.abs(middle) - CENTRES[0, 0]) < HALF_WIDTH) & lids
    i, j = i[~hole], j[~hole]
    faces = np.column_stack([at[i, j], at[i + 1, j], at[i + 1, j + 1], at[i, j + 1]])
    uv = np.column_stack([x, y]) / SIZE.max() + 0.5
    blink = shut - rest
    left = (x > 0)[:, None]
    jaw = np.column_stack([0 * x, -14.0 * np.exp(-((x / 40) ** 2)) * (y < -20), 0 * x])
    deltas = np.stack([blink * left, blink * ~left, jaw]) if shapes else np.zeros((0, len(x), 3))
    names = ("eyeBlinkLeft", "eyeBlinkRight", "jawOpen") if shapes else ()
    return FitMesh(rest, faces, uv, faces.copy(), names, deltas, np.zeros(len(faces), np.int64), ("Head",))


def _placed(x: np.ndarray, y: np.ndarray, row: int, openness: float) -> np.ndarray:
    """The sheet with its lids open, 1, or shut, 0; shut, they meet a little below the middle."""
    across = (np.abs(x) - CENTRES[0, 0]) / HALF_WIDTH
    height = HALF_HEIGHT * np.clip(1.0 - across**2, 0.0, None) * openness
    rows = np.unique(y)
    seam = 0.5 * (rows[row] + rows[row + 1])
    half = 0.5 * (rows[row + 1] - rows[row]) * 0.9
    off = y - seam
    apart = np.exp(-((np.maximum(np.abs(off) - half, 0) / 14.0) ** 2))
    pinched = off - np.sign(off) * half * apart * np.clip((1.6 - np.abs(across)) / 0.5, 0.0, 1.0)
    new_y = 40.0 - 1.0 * apart * (1 - openness) + pinched + np.sign(off) * height * apart + (seam - 40.0) * (1 - apart)
    z = 62.0 - 0.0042 * x**2 - 0.0015 * (new_y - 10.0) ** 2
    ball = (RADIUS + ABOVE) ** 2 - (np.abs(x) - CENTRES[0, 0]) ** 2 - (new_y - CENTRES[0, 1]) ** 2
    front = CENTRES[0, 2] + np.sqrt(np.maximum(ball, 0.0))
    near = np.exp(-np.maximum(across**2 + ((new_y - 40.0) / 10.0) ** 2 - 0.8, 0.0))
    z = np.where(ball > 0, z + near * (front - z), z)
    return np.column_stack([x, new_y, np.where(ball > 0, np.maximum(z, front), z)])


def joined(meshes: list[tuple[str, FitMesh]]) -> FitMesh:
    """Several meshes as pieces of one, with the shapes of all."""
    starts = np.cumsum([0] + [len(m.vertices) for _, m in meshes])
    coords = np.cumsum([0] + [len(m.uv) for _, m in meshes])
    names = tuple(dict.fromkeys(n for _, m in meshes for n in m.names))
    deltas = np.zeros((len(names), int(starts[-1]), 3))
    for (_, m), start in zip(meshes, starts, strict=False):
        for name, delta in zip(m.names, m.deltas, strict=True):
            deltas[names.index(name), start : start + len(m.vertices)] = delta
    return FitMesh(
        np.vstack([m.vertices for _, m in meshes]),
        np.vstack([np.where(m.faces < 0, -1, m.faces + s) for (_, m), s in zip(meshes, starts, strict=False)]),
        np.vstack([m.uv for _, m in meshes]),
        np.vstack([np.where(m.face_uv < 0, -1, m.face_uv + s) for (_, m), s in zip(meshes, coords, strict=False)]),
        names, deltas, np.repeat(np.arange(len(meshes)), [len(m.faces) for _, m in meshes]),
        tuple(n for n, _ in meshes),
    )  # fmt: skip


def shell(centre, radius: float = RADIUS, *, reach: float = np.pi, factors=(1.0, 1.0, 1.0), cornea: float = 0.0,
          rows: int = 17, columns: int = 24) -> FitMesh:  # fmt: skip
    """A ball, or its front as far as ``reach``, rad, from +z; ``factors`` scale its axes; ``cornea`` : how far its
    front bulges, in radii."""
    t = np.linspace(0.0, reach, rows)[1:]
    a = np.linspace(0.0, 2 * np.pi, columns, endpoint=False)
    t2, a2 = (g.ravel() for g in np.meshgrid(t, a, indexing="ij"))
    bulge = 1.0 + cornea * np.clip(1.0 - (t2 / 0.5) ** 2, 0.0, None)
    ring = (bulge * np.stack([np.sin(t2) * np.cos(a2), np.sin(t2) * np.sin(a2), np.cos(t2)])).T
    points = np.vstack([[0.0, 0.0, 1.0 + cornea], ring])
    at = 1 + np.arange(len(t) * columns).reshape(len(t), columns)
    nxt = np.roll(at, -1, axis=1)
    cap = np.column_stack([0 * at[0], at[0], nxt[0], 0 * at[0] - 1])
    quads = np.stack([at[:-1], at[1:], nxt[1:], nxt[:-1]], axis=-1).reshape(-1, 4)
    faces = np.vstack([cap, quads])
    uv = 0.5 + 0.5 * (np.hstack([[0.0], t2]) / np.pi)[:, None] * np.column_stack(
        [np.cos(np.hstack([[0.0], a2])), np.sin(np.hstack([[0.0], a2]))]
    )
    vertices = points * radius * np.array(factors) + np.array(centre)
    return FitMesh(vertices, faces, uv, faces.copy(), (), np.zeros((0, len(vertices), 3)))


def disc(centre, radius: float, depth: float = 0.0) -> FitMesh:
    """A flat round piece that faces +z, bent back by ``depth`` mm at its rim."""
    made = shell((0, 0, 0), 1.0, reach=np.pi / 2, rows=6)
    x, y, _ = made.vertices.T
    flat = np.column_stack([radius * x, radius * y, -depth * (x**2 + y**2)])
    return replace(made, vertices=flat + np.array(centre))


def looking(mesh: FitMesh, centre, side: str, angle: float = 0.4) -> FitMesh:
    """The mesh with the shapes by which an eye looks up, down, in and out about its centre."""
    out, inwards = [], 1.0 if side == "Right" else -1.0
    turns = {"Up": (0.0, -angle), "Down": (0.0, angle), "In": (inwards * angle, 0.0), "Out": (-inwards * angle, 0.0)}
    for yaw, pitch in turns.values():
        c, s, d, e = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
        turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ np.array([[1, 0, 0], [0, d, -e], [0, e, d]])
        out.append((mesh.vertices - centre) @ turn.T + centre - mesh.vertices)
    return replace(mesh, names=tuple(f"eyeLook{k}{side}" for k in turns), deltas=np.stack(out))


def pair(make, names=("EyeLeft", "EyeRight")) -> list[tuple[str, FitMesh]]:
    """A piece for each eye, ``make(centre)``."""
    return [(name, make(centre)) for name, centre in zip(names, CENTRES, strict=True)]


def with_sockets(mesh: FitMesh, reach: float = 13.5) -> FitMesh:
    """The face with skin that goes on from the lids' edges around the backs of the eyes, so that nothing is open."""
    points, uv, faces = [mesh.vertices], [mesh.uv], [mesh.faces]
    count = len(mesh.vertices)
    for outwards in boundary_loops(Island(np.arange(count), mesh.vertices[:, :2], mesh.faces))[1:]:
        loop = last = outwards[::-1]
        local = mesh.vertices[loop] - CENTRES[int(mesh.vertices[loop[0], 0] < 0)]
        start, around = np.arctan2(np.hypot(*local[:, :2].T), local[:, 2]), np.arctan2(local[:, 1], local[:, 0])
        for share in np.linspace(0.15, 1.0, 8):
            polar = start + share * (np.pi - 0.3 - start)
            across = np.sin(polar)[:, None] * np.column_stack([np.cos(around), np.sin(around)])
            points.append(reach * np.column_stack([across, np.cos(polar)]) + mesh.vertices[loop] - local)
            uv.append(mesh.uv[loop] + 0.8 * share * (mesh.uv[loop].mean(axis=0) - mesh.uv[loop]))
            own, count = count + np.arange(len(loop)), count + len(loop)
            faces.append(np.column_stack([np.roll(last, -1), last, own, np.roll(own, -1)])[:, ::-1])
            last = own
        fan = np.full((len(last) - 2, 1), last[0])
        faces.append(np.column_stack([fan, last[1:-1], last[2:], 0 * fan - 1]))
    every = np.vstack(faces)
    grown = np.zeros((len(mesh.names), count, 3))
    grown[:, : len(mesh.vertices)] = mesh.deltas
    return replace(mesh, vertices=np.vstack(points), faces=every, uv=np.vstack(uv), face_uv=every.copy(), deltas=grown,
                   piece=np.zeros(len(every), np.int64))  # fmt: skip


def with_margins(mesh: FitMesh, steps: tuple[float, ...] = (-0.8, -1.6)) -> FitMesh:
    """The face with lids as thick as so many mm: rings that lead from their edges straight towards the eyes' centres,
    and move with the edges in every shape."""
    points, deltas, uv, faces = [mesh.vertices], [mesh.deltas], [mesh.uv], [mesh.faces]
    count = len(mesh.vertices)
    for outwards in boundary_loops(Island(np.arange(count), mesh.vertices[:, :2], mesh.faces))[1:]:
        loop = last = outwards[::-1]
        local = mesh.vertices[loop] - CENTRES[int(mesh.vertices[loop[0], 0] < 0)]
        outward = local / np.linalg.norm(local, axis=1)[:, None]
        for k, step in enumerate(steps):
            points.append(mesh.vertices[loop] + step * outward)
            deltas.append(mesh.deltas[:, loop])
            uv.append(mesh.uv[loop] + 0.1 * (k + 1) * (mesh.uv[loop].mean(axis=0) - mesh.uv[loop]))
            own, count = count + np.arange(len(loop)), count + len(loop)
            faces.append(np.column_stack([np.roll(last, -1), last, own, np.roll(own, -1)])[:, ::-1])
            last = own
    every = np.vstack(faces)
    return replace(
        mesh, vertices=np.vstack(points), faces=every, uv=np.vstack(uv), face_uv=every.copy(),
        deltas=np.concatenate(deltas, axis=1), piece=np.zeros(len(every), np.int64),
    )  # fmt: skip
