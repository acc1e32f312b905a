"""Linings that a blink leaves where they are."""

from dataclasses import replace

import numpy as np
import pytest
from eye_face import CENTRES, RADIUS, face, with_sockets

from surface.fit.eyes.linings import linings, on_rim
from surface.fit.source.mesh import FitMesh

LINED = with_sockets(face())  # what goes on from the lids' edges does not move in a blink
SKIN = len(face().faces)
FIRST = ((LINED.faces >= 0) & (LINED.faces < len(face().vertices))).any(axis=1)  # skin, and a ring of either socket


@pytest.mark.parametrize(("side", "sign"), [("Left", 1.0), ("Right", -1.0)])
def test_what_stays_behind_in_a_blink_is_lining(side: str, sign: float) -> None:
    x = LINED.vertices[LINED.faces[:, 0], 0]
    gone = linings(LINED, FIRST, CENTRES[int(sign < 0)], RADIUS, side)
    ring = FIRST & (np.arange(len(FIRST)) >= SKIN) & (sign * x > 0)
    assert np.isin(gone, np.flatnonzero(ring)).sum() >= 0.8 * ring.sum()  # but at the corners, which hardly move
    assert (gone < SKIN).sum() <= 4 and (sign * x[gone] > 0).all()


def test_lids_whose_edges_move_furthest_have_no_lining() -> None:
    assert not len(linings(face(), np.ones(SKIN, bool), CENTRES[0], RADIUS, "Left"))


def test_without_a_blink_nothing_tells() -> None:
    still = replace(LINED, names=("jawOpen", "mouthLeft", "mouthRight"))
    assert not len(linings(still, FIRST, CENTRES[0], RADIUS, "Left"))


COUNT = 12


def rings(ways: list[float], moving: int = COUNT, *, first: float = 5.0) -> FitMesh:
    """Rings of twelve vertices, 1 mm apart, from a hole outwards, and how far each moves in a blink; on the first
    ring ``moving`` vertices do as said, and the rest moves as far as the next ring."""
    angle = 2 * np.pi * np.arange(COUNT) / COUNT
    at = np.concatenate([(first + k) * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
                         for k in range(len(ways))])  # fmt: skip
    ids = np.arange(len(at)).reshape(-1, COUNT)
    after = np.roll(ids, -1, axis=1)
    faces = np.stack([ids[:-1], ids[1:], after[1:], after[:-1]], axis=-1).reshape(-1, 4)
    way = np.repeat(ways, COUNT)
    way[moving:COUNT] = ways[1]
    delta = np.outer(way, [0.0, 0.6, 0.8])[None]
    none = np.full_like(faces, -1)
    return FitMesh(at, faces, np.zeros((0, 2)), none, ("eyeBlinkLeft",), delta)


def left_out(mesh: FitMesh, radius: float = 10.0) -> list[int]:
    """How many faces of each row of quads are lining."""
    gone = linings(mesh, np.ones(len(mesh.faces), bool), np.zeros(3), radius, "Left")
    return np.bincount(gone // COUNT, minlength=len(mesh.faces) // COUNT).tolist()


@pytest.mark.parametrize(("way", "lags"), [(0.0, True), (1.99, True), (2.01, False)])
def test_a_rim_lags_that_the_next_ring_outdoes_by_half_and_a_tenth_of_a_radius(way: float, lags: bool) -> None:
    """The next ring moves 4 mm: one and a half times 2 mm, and 1 mm."""
    assert left_out(rings([way, 4.0, 4.0, 4.0])) == [12 * lags, 0, 0]


def test_rings_are_left_out_one_after_the_other_up_to_six() -> None:
    assert left_out(rings([0.0, 2.0, 5.0, 5.0, 5.0])) == [12, 12, 0, 0]
    steps = [0.0]
    for _ in range(8):
        steps.append(1.6 * steps[-1] + 1.1)
    assert left_out(rings([*steps, steps[-1]], first=1.0)) == [12] * 6 + [0] * 3


@pytest.mark.parametrize(("moving", "lags"), [(4, False), (5, True)])
def test_five_vertices_that_lag_make_a_lining(moving: int, lags: bool) -> None:
    assert left_out(rings([0.0, 4.0, 4.0], moving)) == [moving + 1 if lags else 0, 0]


@pytest.mark.parametrize(("first", "lags"), [(15.9, True), (16.1, False)])
def test_a_lining_is_near_the_eye(first: float, lags: bool) -> None:
    assert left_out(rings([0.0, 4.0, 4.0], first=first)) == [12 * lags, 0]


def test_a_rim_is_where_an_edge_has_no_opposite() -> None:
    a, b = np.array([0, 1, 2, 1, 3, 2]), np.array([1, 2, 0, 3, 2, 1])  # two triangles that share the edge 1-2
    assert on_rim(a, b, 6).tolist() == [True, True, True, True, False, False]
    assert on_rim(np.append(a, [1, 0, 2, 3]), np.append(b, [0, 2, 3, 1]), 6).tolist() == [False] * 6
