"""Surfaces for heads of surface files: reliefs and balls as NURBS, and a closed T-spline with star points."""

from __future__ import annotations

import numpy as np

from surface import DCPSurface
from surface.readers import NamedSurface

CELLS = 5  # faces along an edge of the cube


def knots(spans: int) -> np.ndarray:
    return np.concatenate([[0.0] * 3, np.linspace(0.0, 1.0, spans + 1), [1.0] * 3])


def relief(count: int = 9, *, turned: bool = False) -> DCPSurface:
    """A hilly sheet of 160 x 200 mm that looks along z; ``turned`` exchanges u and v, so that S_u x S_v looks back."""
    at = np.array([knots(count - 3)[i + 1 : i + 4].mean() for i in range(count)])
    i, j = np.meshgrid(at, at, indexing="ij")
    net = np.stack([160.0 * i - 80.0, 200.0 * j - 100.0, 60.0 * np.sin(np.pi * i) * (0.5 + j * (1.0 - j))], axis=-1)
    if turned:
        net = net.transpose(1, 0, 2)
    return DCPSurface.from_nurbs(3, 3, knots(count - 3), knots(count - 3), net)


def tube(radius: float, height: float) -> DCPSurface:
    """An upright tube about the y axis, closed in u."""
    around, up = 12, 5
    a = 2.0 * np.pi * np.arange(around) / around
    ku = [np.arange(i, i + 5) - 2.0 for i in range(around) for _ in range(up)]
    kv = [knots(up - 3)[j : j + 5] for _ in range(around) for j in range(up)]
    y = height * (np.array([k[1:4].mean() for k in kv[:up]]) - 0.5)
    points = [(radius * np.sin(x), h, radius * np.cos(x)) for x in a for h in y]
    return DCPSurface(points, np.ones(around * up), ku, kv, closed_u=(0.0, float(around)))


def ball(centre: tuple[float, float, float], radius: float) -> DCPSurface:
    """An exact sphere: a rational surface of revolution about y."""
    root = np.sqrt(0.5)
    ring = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)], float)
    arc = np.array([(0, -1), (1, -1), (1, 0), (1, 1), (0, 1)], float)
    net = [[(r * x, y, r * z) for r, y in arc] for x, z in ring]
    weights = np.outer([1, root] * 4 + [1], [1, root, 1, root, 1])
    ku, kv = np.repeat([0, 1, 2, 3, 4], [3, 2, 2, 2, 3]), np.repeat([0, 1, 2], [3, 2, 3])
    return DCPSurface.from_nurbs(2, 2, ku, kv, radius * np.array(net) + centre, weights)


def named(**surfaces: DCPSurface) -> list[NamedSurface]:
    return [NamedSurface(name, surface) for name, surface in surfaces.items()]


def cube_grips(cells: int = CELLS) -> tuple[list[tuple[int, int, int]], list[list[int]]]:
    """Lattice places of a cube's faces, and its quads, anticlockwise from outside."""
    places: dict[tuple[int, int, int], int] = {}
    quads = []
    for axis in range(3):
        for side in (0, cells):
            for i in range(cells):
                for j in range(cells):
                    ring = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
                    corners = [tuple(int(x) for x in np.insert(c, axis, side)) for c in ring]
                    outwards = (side > 0) != (axis == 1)
                    quads.append([places.setdefault(c, len(places)) for c in (corners if outwards else corners[::-1])])
    return list(places), quads


def bulge(place: tuple[int, int, int], cells: int = CELLS) -> np.ndarray:
    """Where a grip of the cube lies."""
    x, y, z = np.array(place) - cells / 2
    return np.array([20 * x + 2 * y, 24 * y + z * z, 20 * z + 3 * np.sin(x)])


def cube_tsm(cells: int = CELLS) -> str:
    """A closed T-spline over a cube: eight star points where three faces meet, knot intervals of 1."""
    places, quads = cube_grips(cells)
    pairs = [(a, b) for q in quads for a, b in zip(q, q[1:] + q[:1], strict=True)]
    number = {pair: k for k, pair in enumerate(pairs)}
    edges = {edge: k for k, edge in enumerate(sorted({(min(p), max(p)) for p in pairs}))}
    lines = ["#TS0200", "", "degree 3", "cap-type G1CAPS"]
    lines += [f"f {4 * face} 0" for face in range(len(quads))] + [f"e {number[edge]} 1" for edge in edges]
    first: dict[int, int] = {}
    for pair, k in number.items():
        first.setdefault(pair[0], k)
    lines += [f"v {first[v]} NORTH" for v in range(len(places))]
    for (a, b), k in number.items():
        face = k // 4
        around = f"{4 * face + (k + 3) % 4} {4 * face + (k + 1) % 4} {number[b, a]}"
        lines.append(f"l {around} {a} {face} {edges[min(a, b), max(a, b)]} 0")
    lines += ["0g " + " ".join(map(repr, [*bulge(p, cells).tolist(), 1.0])) for p in places]
    return "\n".join(lines) + "\n"
