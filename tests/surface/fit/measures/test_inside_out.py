"""surface.fit.measures.inside_out: triangles that face the other way than the mesh about them, and nothing else."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from surface.fit.measures.inside_out import InsideOutFaces

N = 9  # vertices along each side
UV = np.stack(np.meshgrid(np.linspace(0, 1, N), np.linspace(0, 1, N), indexing="ij"), axis=-1).reshape(-1, 2)


def triangles() -> np.ndarray:
    """(2 (N - 1)^2, 3) of the grid, whose normals point up."""
    i, j = (each.ravel() for each in np.meshgrid(np.arange(N - 1), np.arange(N - 1), indexing="ij"))
    a = i * N + j
    return np.concatenate([np.stack([a, a + N, a + N + 1], 1), np.stack([a, a + N + 1, a + 1], 1)])


def chart(weight: np.ndarray | None = None, **other: Any) -> Any:
    """A chart whose mesh is the same grid: each square's slopes along u and along v."""
    i, j = (each.ravel() for each in np.meshgrid(np.arange(N - 1), np.arange(N - 1), indexing="ij"))
    a, rows = i * N + j, np.arange((N - 1) ** 2)
    mixes = []
    for other_end in (N, 1):
        values, columns = np.tile([-1.0, 1.0], len(rows)), np.column_stack([a, a + other_end]).ravel()
        mixes.append(csr_matrix((values, (np.repeat(rows, 2), columns)), shape=(len(rows), N * N)))
    weight = np.ones(len(rows)) if weight is None else weight
    slopes = SimpleNamespace(uv=(UV[a] + UV[a + N + 1]) / 2, mix_u=mixes[0], mix_v=mixes[1], weight=weight, **other)
    return SimpleNamespace(chart=SimpleNamespace(slopes=slopes))


def faces(fitted: Any, own: np.ndarray | None = None) -> InsideOutFaces:
    part: Any = SimpleNamespace(triangles=triangles() if own is None else own, uv=UV)
    return InsideOutFaces(fitted, part)


def hill() -> np.ndarray:
    """(N^2, 3) mm: a sheet of 80 x 80 mm that bulges."""
    return np.column_stack([80.0 * UV, 10.0 * np.sin(np.pi * UV).prod(axis=1)])


def test_a_surface_that_lies_as_the_mesh_does_is_nowhere_inside_out() -> None:
    area, places = faces(chart()).find(hill(), hill())
    assert area == 0.0 and places.shape == (0, 2)


def test_a_surface_that_is_turned_over_is_everywhere() -> None:
    area, places = faces(chart(), triangles()[:, ::-1]).find(hill(), hill())
    corners = hill()[triangles()]
    whole = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    assert area == pytest.approx(whole) and len(places) == len(triangles())


def test_only_triangles_in_a_fold_are_counted_with_their_places() -> None:
    """A row of vertices lies behind the next one: the strip between them runs back."""
    surface = hill()
    row = np.flatnonzero(np.isclose(UV[:, 0], 0.5))
    surface[row, 0] += 25.0
    area, places = faces(chart()).find(surface, hill())
    assert len(places) == 2 * (N - 1)
    assert ((places[:, 0] > 0.5) & (places[:, 0] < 0.625)).all()
    assert area == pytest.approx(15.0 * 80.0, rel=0.1)


def test_all_faces_of_the_mesh_about_a_triangle_must_oppose_it() -> None:
    """Where one face beyond a crease runs the same way, nothing is said."""
    mesh = hill()
    row = np.flatnonzero(np.isclose(UV[:, 0], 0.5))
    mesh[row, 0] += 25.0  # the fold is the mesh's own, but the surface lies flat
    area, places = faces(chart()).find(hill(), mesh)
    assert area == 0.0 and len(places) == 0


@pytest.mark.parametrize(("degrees", "counted"), [(95.0, False), (100.0, False), (103.0, True), (180.0, True)])
def test_what_stands_across_is_not_inside_out(degrees: float, counted: bool) -> None:
    """From a cosine of -0.2 on, which are 101.5 degrees."""
    flat = np.column_stack([80.0 * UV, np.zeros(len(UV))])
    angle = np.radians(degrees)
    turned = np.column_stack([flat[:, 0], np.cos(angle) * flat[:, 1], np.sin(angle) * flat[:, 1]])
    assert (faces(chart()).find(turned, flat)[0] > 0.0) is counted


def test_faces_in_slivers_do_not_say_which_way_a_surface_goes() -> None:
    weight = np.ones((N - 1) ** 2)
    few = slice((N - 1) ** 2 // 4)
    weight[few] = 0.4  # of the usual weight; from half of it on they count
    area, places = faces(chart(weight), triangles()[:, ::-1]).find(hill(), hill())
    assert 0 < len(places) < len(triangles()) and places[:, 0].min() > 0.25
    weight[few] = 0.6
    assert len(faces(chart(weight), triangles()[:, ::-1]).find(hill(), hill())[1]) == len(triangles())
    assert area > 0.0


def test_where_only_positions_were_fitted_or_there_are_few_faces_nothing_is_said() -> None:
    none: Any = SimpleNamespace(chart=SimpleNamespace(slopes=None))
    few = chart()
    few.chart.slopes.uv = few.chart.slopes.uv[:3]
    for fitted, own in ((none, None), (few, None), (chart(), triangles()[:0])):
        area, places = faces(fitted, own).find(-hill(), hill())
        assert area == 0.0 and places.shape == (0, 2)
