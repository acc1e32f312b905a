"""Skin behind an eyeball that nobody sees, and what is seen of it."""

from dataclasses import replace

import numpy as np
import pytest
from eye_face import CENTRES, RADIUS, face, shell, with_sockets

from surface.fit.eyes import sockets as module
from surface.fit.eyes.sockets import hidden_faces


@pytest.fixture(scope="module")
def deep():
    return with_sockets(face(shapes=False))


def test_the_back_of_a_socket_is_hidden_and_lids_and_the_face_are_not(deep) -> None:
    skin = np.ones(len(deep.faces), bool)
    bare = len(face(shapes=False).faces)
    for k, centre in enumerate(CENTRES):
        gone = hidden_faces(deep, skin, centre, RADIUS)
        middle = deep.vertices[deep.faces[gone, :3]].mean(axis=1)
        assert len(gone) > 100 and (gone >= bare).all() and len(set(gone.tolist())) == len(gone)
        assert np.linalg.norm(middle - centre, axis=1).max() < 1.6 * RADIUS
        own = np.flatnonzero(np.arange(len(deep.faces)) >= bare)
        near = own[np.linalg.norm(deep.vertices[deep.faces[own, :3]].mean(axis=1) - centre, axis=1) < 20]
        behind = near[deep.vertices[deep.faces[near, :3]].mean(axis=1)[:, 2] < centre[2] - 4.0]
        assert np.isin(behind, gone).mean() > 0.9, k


def test_skin_that_ends_at_the_lids_hides_nothing() -> None:
    mesh = face(shapes=False)
    assert not len(hidden_faces(mesh, np.ones(len(mesh.faces), bool), CENTRES[0], RADIUS))
    assert not len(hidden_faces(mesh, np.zeros(len(mesh.faces), bool), CENTRES[0], RADIUS))
    assert not len(hidden_faces(mesh, np.ones(len(mesh.faces), bool), CENTRES[0] + 500.0, RADIUS))


def test_only_skin_goes(deep) -> None:
    bare = len(face(shapes=False).faces)
    skin = np.arange(len(deep.faces)) < bare
    assert not len(hidden_faces(deep, skin, CENTRES[0], RADIUS))


def ahead(points, tri=((9.0, 9, 9), (9.1, 9, 9), (9, 9.1, 9))):
    return module._seen(np.array(points, float), np.array([tri], float)).tolist()


def test_an_eyeball_hides_what_is_behind_it_from_the_front_and_half_aside() -> None:
    assert ahead([[0, 0, -1.2], [0, 0, 1.0], [0, 0, 1.3]]) == [False, True, True]
    assert ahead([[0.97, 0, -0.5], [1.2, 0, -0.5], [0, 1.2, -0.5]]) == [True, True, True]
    assert ahead([[0.3, 0.0, -1.1], [0.0, 0.3, -1.1], [0.6, 0, -0.9]]) == [False, False, True]
    assert ahead([[0.99, 0, 0.0], [0, 0.99, 0.05]]) == [True, True]  # what lies on its rim


def test_a_wall_hides_what_is_behind_it_but_not_itself() -> None:
    wall = ((-0.4, -0.4, 1.2), (0.4, -0.4, 1.2), (0, 0.4, 1.2))
    at = [[0, -0.1, z] for z in (1.09, 1.19, 1.3, 1.17)]
    assert ahead(at, wall) == [False, True, True, True]
    assert ahead([[0.3, -0.3, 1.0], [0, -0.1, 0.5]], wall) == [True, False]  # seen from aside; behind the ball's front


def test_samples_cover_a_triangle_no_further_apart_than_pixels() -> None:
    tri = np.array([[[0.0, 0, 0], [0.5, 0, 0], [0, 0.4, 0]], [[0, 0, 1.0], [0.01, 0, 1], [0, 0.01, 1]]])
    found = module._samples(tri)
    flat, small = found[found[:, 2] == 0], found[found[:, 2] == 1]
    assert len(small) == 3 and (flat[:, :2] >= -1e-12).all() and (flat[:, 0] / 0.5 + flat[:, 1] / 0.4 <= 1 + 1e-9).all()
    steps = np.ceil(np.hypot(0.5, 0.4) / (0.7 * module.PIXEL))
    assert len(flat) == (steps + 1) * (steps + 2) / 2
    asked = np.random.default_rng(0).dirichlet(np.ones(3), 300) @ tri[0]
    off = np.linalg.norm(asked[:, None] - flat[None], axis=2).min(axis=1)
    assert off.max() < 0.7 * module.PIXEL
    huge = module._samples(100 * tri[:1])
    assert len(huge) == 25 * 26 / 2


def test_of_hidden_faces_those_behind_the_centre_go_and_not_what_lies_beside() -> None:
    one, other = shell((0, 0, 0), reach=1.0), shell((40, 0, 0), reach=1.0)
    faces = np.vstack([one.faces, np.where(other.faces < 0, -1, other.faces + len(one.vertices))])
    mesh = replace(one, vertices=np.vstack([one.vertices, other.vertices]), faces=faces)
    every = np.arange(len(faces))
    np.testing.assert_array_equal(module._behind(mesh, every, np.array([1.0, 0, 0])), every[: len(one.faces)])
    np.testing.assert_array_equal(module._behind(mesh, every, np.array([39.0, 2, 0])), every[len(one.faces) :])
    assert not len(module._behind(mesh, every[:0], np.zeros(3)))


def test_pixels_are_clipped_to_the_picture() -> None:
    i, j = module._pixels(np.array([[-9.0, 9, 0], [-4.0, -4.0, 0], [-4.0 + 1.5 * 0.04, 0, 0]]), 200)
    assert i.tolist() == [0, 0, 1] and j.tolist() == [199, 0, 100]


def test_a_ball_is_as_deep_as_a_sphere_a_little_smaller_than_the_eye(monkeypatch) -> None:
    monkeypatch.setattr(module, "VIEWS", ((0.0, 0.0),))
    for across in (0.0, 0.3, 0.7, 0.9, 0.95):
        front = np.sqrt(0.96**2 - across**2) - module.MIN_DEPTH
        for turn in (0.0, 1.1, 4.0):
            x, y = across * np.cos(turn), across * np.sin(turn)
            assert ahead([[x, y, front + 0.01], [x, y, front - 0.01]]) == [True, False], across
    assert ahead([[0.97, 0, -1.0]]) == [True]


def test_what_is_seen_from_any_side_is_seen_from_the_others() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-1.2, 1.2, (400, 3)) - np.array([0, 0, 0.6])
    for factors in ([-1.0, 1, 1], [1.0, -1, 1]):
        assert ahead(points) == ahead(points * np.array(factors))
    seen = np.array(ahead(points))
    assert 40 < seen.sum() < 360
