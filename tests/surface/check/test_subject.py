"""What the checks measure a head by."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from surface.check.subject import pose_of
from surface.head.model.parameters import ANGLES
from tests.surface.check import plain

POINTS, TRIANGLES = plain.sheet((-50, 50), (-100, 15), 5.0)


def skin(name: str = "face", **moves: tuple[float, float, float]):
    shapes = {n: np.tile(np.array(m), (len(POINTS), 1)) for n, m in moves.items()}
    return plain.part(name, POINTS, TRIANGLES, moves=shapes)


def test_what_a_head_claims_are_its_groups_its_jaw_its_angles_and_those_of_the_eyes_it_has() -> None:
    neck = [n for n in ANGLES if n.startswith("head")]
    assert plain.subject(skin(cheekPuff=(0, 0, 1))).claimed == ("cheekPuff", *neck)
    both = plain.subject(skin(cheekPuff=(0, 0, 1), unknown=(0, 0, 1)), plain.eyeball(1), jaw=0.4)
    assert both.claimed == ("jawOpen", "cheekPuff", *neck, "rightEyeYaw", "rightEyePitch")
    assert plain.subject(skin(), plain.eyeball(0)).claimed == (*neck, "leftEyeYaw", "leftEyePitch")


def test_mouth_close_moves_from_the_open_jaw() -> None:
    head = plain.subject(skin(jawOpen=(0, -9, 0), mouthClose=(0, 4, 1)))
    np.testing.assert_allclose(head.moves("mouthClose")[0][0], [0, 4, 1], atol=1e-5)
    np.testing.assert_allclose(head.moves("jawOpen")[0][0], [0, -9, 0], atol=1e-5)
    np.testing.assert_allclose(head.at_one("mouthClose")[0][0] - POINTS[0], [0, -5, 1], atol=1e-5)
    assert pose_of("mouthClose") == {"mouthClose": 1.0, "jawOpen": 1.0} and pose_of("jawOpen") == {"jawOpen": 1.0}


def test_a_pose_is_made_once_and_again_where_the_parts_have_to_be_in_it() -> None:
    head = plain.subject(skin(jawOpen=(0, -9, 0)))
    for _ in range(2):
        head.posed({"jawOpen": 1.0})
    assert head.head.posed == 2  # type: ignore[attr-defined]
    head.posed_now({})
    assert head.head.parts[0].vertices[0, 1] == pytest.approx(-100.0)
    head.posed_now({"jawOpen": 1.0})
    assert head.head.parts[0].vertices[0, 1] == pytest.approx(-109.0)


def test_skin_is_sorted_by_its_vertices_and_pictures_leave_hair_out() -> None:
    small = plain.part("ear", *plain.sheet((0, 5), (0, 5), 5.0))
    lash = plain.part("lash", *plain.sheet((0, 5), (0, 5), 5.0), material="lash")
    head = plain.subject(small, lash, skin())
    assert head.skin.tolist() == [2, 0]
    drawn = head.shapes(head.rest)
    assert drawn[1] is None and drawn[2] is not None
    assert drawn[2][0] is head.rest[2] and drawn[2][1] is head.parts[2].triangles
    assert head.shapes(head.rest, without=("skin",))[1] is not None


def test_the_skin_with_lids_or_lips_is_the_face_whatever_its_size() -> None:
    back = plain.part("back", *plain.sheet((-90, 90), (-200, 90), 5.0))
    head = plain.subject(back, skin("mask"))
    assert head.skin.tolist() == [0, 1]
    head = plain.subject(back, skin("mask"))
    head.head.data.contacts.append(SimpleNamespace(part="mask"))
    assert head.skin.tolist() == [1, 0]


def test_a_head_is_measured_by_its_eyes_and_without_them_by_its_height() -> None:
    assert plain.subject(skin()).scale == pytest.approx(1.0)
    assert plain.subject(skin(), eyes=2.0 * plain.EYES).scale == pytest.approx(2.0)
    blind = plain.subject(skin(), eyes=None)
    assert blind.eyes is None and blind.height == pytest.approx(115.0) and blind.scale == pytest.approx(0.5)
    assert plain.subject(skin(), eyes=0.0 * plain.EYES).scale == pytest.approx(0.5)
    nothing = plain.subject(plain.eyeball(0), eyes=None)
    assert nothing.height == 0.0 and 0.0 < nothing.scale < 1e-6


def test_an_eyeball_is_the_part_that_follows_the_eye() -> None:
    head = plain.subject(skin(), plain.eyeball(1), plain.eyeball(0))
    assert (head.eye(0), head.eye(1)) == (2, 1)
    assert plain.subject(skin()).eye(0) is None
