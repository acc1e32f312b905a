"""Islands and their loops."""

import numpy as np
from slit_sheet import SLIT, N, slit_sheet

from surface.fit.source.islands import boundary_loops, find_islands
from surface.fit.source.mesh import FitMesh


def test_one_island_with_an_outline_and_a_slit():
    (island,) = find_islands(slit_sheet())
    outline, slit = boundary_loops(island)
    assert len(outline) == 4 * N
    assert len(slit) == 2 * (SLIT[1] - SLIT[0]) + 2
    assert set(island.vertex) == set(range((N + 1) ** 2))


def test_loops_run_with_the_surface_on_their_left():
    outline, slit = (find_islands(slit_sheet())[0].uv[loop] for loop in boundary_loops(find_islands(slit_sheet())[0]))

    def area(p):
        q = np.roll(p, -1, axis=0)
        return 0.5 * (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum()

    assert abs(area(outline) - 1.0) < 1e-12
    assert area(slit) < 0


def test_corners_with_equal_texture_are_welded():
    mesh = slit_sheet()
    uv = mesh.uv[mesh.face_uv].reshape(-1, 2)
    split = FitMesh(mesh.vertices, mesh.faces, uv, np.arange(len(uv)).reshape(-1, 4), mesh.names, mesh.deltas)
    assert len(find_islands(split)) == 1


def test_a_cut_in_the_texture_makes_two_islands():
    mesh = slit_sheet()
    uv = np.vstack([mesh.uv, mesh.uv + np.array([2.0, 0.0])])
    right = mesh.vertices[mesh.faces].mean(axis=1)[:, 0] > 0
    face_uv = np.where(right[:, None], mesh.face_uv + len(mesh.uv), mesh.face_uv)
    islands = find_islands(FitMesh(mesh.vertices, mesh.faces, uv, face_uv, mesh.names, mesh.deltas))
    assert sorted(len(i.faces) for i in islands) == sorted([int(right.sum()), int((~right).sum())])


def test_loops_that_touch_in_a_point_are_two():
    quad = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [2, 1], [2, 2], [1, 2]])
    vertices = np.column_stack([quad, np.zeros(7)])
    faces = np.array([[0, 1, 2, 3], [2, 4, 5, 6]])
    mesh = FitMesh(vertices, faces, quad, faces, (), np.zeros((0, 7, 3)))
    loops = [boundary_loops(i) for i in find_islands(mesh)]
    joined = sorted(len(loop) for island in loops for loop in island)
    assert joined == [4, 4]


def test_a_third_face_at_an_inner_edge_has_a_border_of_its_own():
    """A fin of one triangle on a sheet: at its foot three faces meet."""
    size = 4
    grid = np.arange((size + 1) ** 2).reshape(size + 1, size + 1)
    v, u = np.divmod(grid.ravel(), size + 1)
    vertices = np.vstack([np.column_stack([u, v, np.zeros(len(u))]), [1.5, 2.0, 1.0]]).astype(float)
    quads = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4)
    faces = np.vstack([quads, [grid[2, 1], grid[2, 2], len(u), -1]])
    uv = vertices[:, :2] / (2 * size)
    uv[-1] = 0.9, 0.9
    (island,) = find_islands(FitMesh(vertices, faces, uv, faces, (), np.zeros((0, len(vertices), 3))))
    loops = [set(island.vertex[loop].tolist()) for loop in boundary_loops(island)]
    border = {*grid[0].tolist(), *grid[-1].tolist(), *grid[:, 0].tolist(), *grid[:, -1].tolist()}
    assert sorted(loops, key=len) == [{int(grid[2, 1]), int(grid[2, 2]), len(u)}, border]
