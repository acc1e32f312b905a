"""ARKit's shapes out of others: halves, moods cut into regions, shares of one shape in another."""

import numpy as np
import pytest

from surface.fit.source.mesh import FitMesh
from surface.fit.source.names import NameMap, Source
from surface.fit.source.naming.shapes import empty_shapes, share_of, to_arkit

X, Y = (a.ravel() for a in np.meshgrid(np.linspace(-50, 50, 41), np.linspace(-60, 60, 49), indexing="ij"))
AT = np.column_stack([X, Y, 0 * X])
ONE = np.ones((len(X), 3))
MOUTH, EYES = np.exp(-(((Y + 30) / 6) ** 2)), np.exp(-(((Y - 20) / 4) ** 2))


def mesh(*deltas, pieces=(), piece=None) -> FitMesh:
    rows = np.arange(len(X)).reshape(41, 49)
    faces = np.stack([rows[:-1, :-1], rows[1:, :-1], rows[1:, 1:], rows[:-1, 1:]], axis=-1).reshape(-1, 4)
    own = np.zeros(len(faces), np.int64) if piece is None else piece(AT[faces].mean(axis=1)).astype(np.int64)
    names = tuple(f"s{k}" for k in range(len(deltas)))
    return FitMesh(
        AT, faces, np.zeros((0, 2)), 0 * faces - 1, names, np.array(deltas), own if pieces else own[:0], pieces
    )


def made(source: Source | list[Source], own: FitMesh, mouth=(), eyes=()) -> np.ndarray:
    every = source if isinstance(source, list) else [source]
    out = to_arkit(own, NameMap({"jawOpen": every}, (), (), mouth=mouth, eyes=eyes))
    assert out.names == ("jawOpen",) and out.deltas.shape == (1, len(X), 3)
    return out.deltas[0]


def test_halves_add_up_to_the_whole_and_fade_over_a_band_about_the_middle() -> None:
    own = mesh(2.0 * ONE)
    left, right = (made(Source(0, side), own)[:, 0] for side in ("Left", "Right"))
    np.testing.assert_allclose(left + right, 2.0)
    assert (left[X > 6.1] == 2).all() and (left[X < -6.1] == 0).all()
    np.testing.assert_allclose(left[X == 0], 1.0)
    np.testing.assert_allclose(left[X == 2.5], 2 * (0.5 + 0.25 * (2.5 / 6) * (3 - (2.5 / 6) ** 2)))
    shifted = FitMesh(AT + np.array([500.0, 0, 0]), own.faces, own.uv, own.face_uv, own.names, own.deltas)
    np.testing.assert_allclose(made(Source(0, "Left"), shifted)[:, 0], left)
    np.testing.assert_array_equal(made([Source(0), Source(0, "Left")], own)[:, 0], 2.0 + left)


def test_a_mood_is_cut_into_mouth_eyes_and_brows_which_add_up_to_it() -> None:
    own = mesh(ONE, -MOUTH[:, None] * ONE, EYES[:, None] * [1.0, -2.0, 0.5])
    mouth, eyes, brows = (made(Source(0, "", r), own, (1,), (2,))[:, 0] for r in ("mouth", "eyes", "brows"))
    np.testing.assert_allclose(mouth + eyes + brows, 1.0, atol=1e-9)
    assert (mouth[Y < -14] == 1).all() and (mouth[Y > 9] == 0).all() and mouth.min() >= 0
    middle = -30 + 0.55 * 50
    assert (mouth[middle - 0.1 > Y] > 0.5).all() and (mouth[middle + 0.1 < Y] < 0.5).all()
    lid = np.abs(Y - 20) < 2
    assert (eyes[lid] > 0.8).all() and (brows[Y > 45] == 1).all() and (brows[Y < 18] == 0).all()
    np.testing.assert_array_equal(made(Source(0), own, (1,), (2,)), ONE)
    for known in (((), (2,)), ((1,), ())):
        for region in ("mouth", "eyes", "brows"):
            np.testing.assert_array_equal(made(Source(0, "", region), own, *known), ONE)


def test_brows_that_are_pieces_are_brows_and_eyes_end_below_them() -> None:
    own = mesh(
        ONE,
        MOUTH[:, None] * ONE,
        EYES[:, None] * ONE,
        pieces=("Skin", "Eyebrow"),
        piece=lambda p: np.abs(p[:, 1] - 32) < 3,
    )
    eyes, brows = (made(Source(0, "", r), own, (1,), (2,))[:, 0] for r in ("eyes", "brows"))
    assert (brows[np.abs(Y - 32) < 3] == 1).all() and (eyes[np.abs(Y - 32) < 3] == 0).all()
    assert (eyes[np.abs(Y - 16) < 1] > 0.8).all() and (brows[Y < 15] == 0).all()


def test_where_mouth_and_eyes_are_in_one_place_nothing_is_cut() -> None:
    own = mesh(ONE, ONE, ONE)
    np.testing.assert_array_equal(made(Source(0, "", "mouth"), own, (1,), (2,)), ONE)
    still = mesh(ONE, 0 * ONE, 0 * ONE)
    np.testing.assert_array_equal(made(Source(0, "", "eyes"), still, (1,), (2,)), ONE)


@pytest.mark.parametrize(("much", "share"), [(0.0, 0.0), (0.4, 0.4), (1.0, 1.0), (1.7, 1.0), (-0.5, 0.0)])
def test_a_share_of_another_shape_is_found_and_taken_away(much: float, share: float) -> None:
    a, b = MOUTH[:, None] * [0, 1.0, 0], EYES[:, None] * [0, 0, 1.0]
    own = mesh(a + much * b, b, 0 * b)
    assert share_of(own, 0, 1) == pytest.approx(share) and share_of(own, 0, 2) == 0.0
    np.testing.assert_allclose(made(Source(0, less=1), own), a + (much - share) * b, atol=1e-12)
    np.testing.assert_array_equal(made(Source(0, less=-1), own), a + much * b)
    np.testing.assert_allclose(made(Source(1, less=0), own)[:, 1], -share_of(own, 1, 0) * a[:, 1], atol=1e-12)


def test_shapes_that_move_nothing_as_far_as_can_be_seen_are_empty() -> None:
    tiny = np.zeros((len(X), 3))
    tiny[7] = [0, -1.1e-3, 0]  # of 120 mm
    assert empty_shapes(mesh(ONE, 0 * ONE, tiny, tiny / 1.2)) == {1, 2, 3}
    assert empty_shapes(mesh(2 * tiny, -tiny * 1.2)) == set()
    assert empty_shapes(mesh()) == set()
