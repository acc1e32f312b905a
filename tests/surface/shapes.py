"""Surfaces, domains and mesh measures that several tests share."""

from __future__ import annotations

import numpy as np

from surface import DCPSurface, Domain, Mesh


def scattered(n: int, seed: int, degrees: tuple[int, int] = (1, 9)) -> DCPSurface:
    """Random points over the unit square, random degrees and knots, the whole square covered."""
    rng = np.random.default_rng(seed)
    knots: list[list[np.ndarray]] = [[], []]
    for _ in range(n):
        for side in knots:
            p = int(rng.integers(degrees[0], degrees[1] + 1))
            low = rng.uniform(-0.3, 0.9)
            side.append(np.sort(rng.uniform(low, low + rng.uniform(0.2, 0.8), p + 2)))
    cover = np.array([-0.5, -0.2, 0.4, 1.2, 1.6])
    knots[0].append(cover)
    knots[1].append(cover)
    return DCPSurface(rng.normal(size=(n + 1, 3)), rng.uniform(0.3, 3, n + 1), knots[0], knots[1])


def hills(n: int = 24, size: float = 100.0, degree: int = 3) -> DCPSurface:
    """A wavy square sheet over the unit square as an (n, n) NURBS net."""
    knots = np.concatenate([[0] * degree, np.linspace(0, 1, n - degree + 1), [1] * degree])
    x, y = np.meshgrid(np.linspace(0, size, n), np.linspace(0, size, n), indexing="ij")
    z = 0.1 * size * np.sin(x / size * 8) * np.cos(y / size * 11)
    return DCPSurface.from_nurbs(degree, degree, knots, knots, np.stack([x, y, z], axis=-1))


def torn(n: int = 16) -> DCPSurface:
    """Two sheets over the unit square that meet along v = 0.5, the upper one 10 higher: a cut all the way."""
    knots = np.concatenate([[0] * 3, np.linspace(0, 1, n - 2), [1] * 3])
    lower = DCPSurface.from_nurbs(3, 3, knots, knots / 2, sheet(n, 0.0))
    upper = DCPSurface.from_nurbs(3, 3, knots, 0.5 + knots / 2, sheet(n, 10.0))
    return DCPSurface(
        np.vstack([lower.points, upper.points]),
        np.ones(2 * n * n),
        [*lower.knots_u, *upper.knots_u],
        [*lower.knots_v, *upper.knots_v],
    )


ROUND, ACROSS = 14, 9


def uniform(count: int) -> np.ndarray:
    """(count, 5): cubic knots of points spread evenly over 0..1."""
    return (np.arange(count)[:, None] + np.arange(-2, 3)) / count


def torus() -> DCPSurface:
    """A ring closed in both directions, 14 by 9 control points."""
    a, b = 2 * np.pi * np.arange(ROUND) / ROUND, 2 * np.pi * np.arange(ACROSS) / ACROSS
    ring = 30 + 10 * np.cos(b)[None, :]
    points = np.stack([ring * np.cos(a)[:, None], ring * np.sin(a)[:, None], 0 * a[:, None] + 10 * np.sin(b)], axis=-1)
    knots_u, knots_v = np.repeat(uniform(ROUND), ACROSS, axis=0), np.tile(uniform(ACROSS), (ROUND, 1))
    return DCPSurface(
        points.reshape(-1, 3), np.ones(ROUND * ACROSS), knots_u, knots_v, closed_u=(0, 1), closed_v=(0, 1)
    )


def sheet(n: int, height: float) -> np.ndarray:
    """(n, n, 3) flat net."""
    x, y = np.meshgrid(np.linspace(0, 100, n), np.linspace(0, 50, n), indexing="ij")
    return np.stack([x, y + (50 if height else 0), np.full_like(x, height)], axis=-1)


def circle(u: float, v: float, radius: float, flat: float = 1.0, n: int = 160) -> np.ndarray:
    """(n, 2) ellipse."""
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return np.stack([u + radius * np.cos(angle), v + flat * radius * np.sin(angle)], axis=1)


def eye(u: float, v: float, width: float, height: float, n: int = 40) -> np.ndarray:
    """Lens with two sharp corners."""
    t = np.linspace(-1, 1, n)
    lid = height * np.cos(t * np.pi / 2)
    upper, lower = np.stack([u + width * t, v + lid], 1), np.stack([u + width * t, v - lid], 1)
    return np.concatenate([lower[:-1], upper[::-1][:-1]])


def face_like() -> Domain:
    """Outline, a flat mouth hole, two eyes: like the domains heads have."""
    loops = [
        circle(0.5, 0.5, 0.45),
        circle(0.5, 0.3, 0.1, 0.25),
        eye(0.35, 0.62, 0.06, 0.02),
        eye(0.65, 0.62, 0.06, 0.006),
    ]
    return Domain((0, 1, 0, 1), loops=loops)


def edge_uses(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Undirected edges (e, 2) and how many triangles use each."""
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return np.unique(edges, axis=0, return_counts=True)


def check_manifold(mesh: Mesh) -> None:
    """Every directed edge at most once, so every edge has one or two triangles, consistently oriented."""
    directed = mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert len(np.unique(directed, axis=0)) == len(directed)
    assert edge_uses(mesh.triangles)[1].max() <= 2


def uv_areas(mesh: Mesh) -> np.ndarray:
    """(t,) signed areas in (u, v)."""
    a, b, c = (mesh.uv[mesh.triangles[:, k]] for k in range(3))
    return ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2


def least_angles(mesh: Mesh) -> np.ndarray:
    """(t,) smallest angle of every triangle in degrees."""
    corner = mesh.vertices[mesh.triangles]
    angles = []
    for k in range(3):
        p, q = corner[:, (k + 1) % 3] - corner[:, k], corner[:, (k + 2) % 3] - corner[:, k]
        cosine = (p * q).sum(1) / (np.linalg.norm(p, axis=1) * np.linalg.norm(q, axis=1))
        angles.append(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    return np.min(angles, axis=0)


def border(mesh: Mesh) -> np.ndarray:
    """(e, 2) edges with one triangle."""
    edges, uses = edge_uses(mesh.triangles)
    return edges[uses == 1]


def distance_to_loops(points: np.ndarray, domain: Domain) -> np.ndarray:
    """(m,) distance in (u, v) of ``points (m, 2)`` from the nearest loop segment."""
    a, b = domain.segments[:, :2], domain.segments[:, 2:]
    along = b - a
    t = ((points[:, None] - a) * along).sum(-1) / (along * along).sum(-1)
    nearest = a + np.clip(t, 0, 1)[..., None] * along
    return np.linalg.norm(points[:, None] - nearest, axis=-1).min(axis=1)
