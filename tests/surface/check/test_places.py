"""Names of places on a face of usual proportions, by points measured in millimetres."""

from __future__ import annotations

import numpy as np
import pytest

from surface.check.places import Places
from tests.surface.check import plain

# x to the left, y up, z forward, mm, from the middle between the fronts of the eyeballs of eyes 63.6 mm apart
POINTS = {
    "left eye": (31, 2, 1), "right brow": (-36, 19, 12), "forehead": (5, 48, 17), "left temple": (63, 21, -31),
    "nose": (0, -30, 42), "right nostril": (-11, -39, 28), "bridge of the nose": (0, -2, 17),
    "left cheek": (46, -38, 3), "left ear": (73, -20, -68), "right mouth corner": (-24, -68, 17),
    "upper lip": (0, -57, 32), "lower lip": (2, -76, 31), "chin": (0, -107, 23), "left jaw": (48, -90, -22),
    "throat": (0, -140, -25), "right neck": (-38, -160, -56), "top of the head": (0, 95, -60),
    "back of the head": (0, 10, -150), "nape": (0, -92, -122), "left side of the head": (76, 34, -78),
}  # fmt: skip
FRONT = np.array([0.0, 0.0, plain.RADIUS])


@pytest.fixture(scope="module")
def places() -> Places:
    return Places(plain.subject(plain.part("face", *plain.sheet((-5, 5), (-5, 5), 5.0))), None)


@pytest.mark.parametrize("name", POINTS)
def test_a_point_has_the_name_of_its_place(places: Places, name: str) -> None:
    assert places.name(np.array(POINTS[name]) + FRONT) == name


@pytest.mark.parametrize(("x", "side"), [(0.0, ""), (7.0, ""), (-7.0, ""), (8.3, "left "), (-8.3, "right ")])
def test_sides_begin_an_eighth_of_the_distance_of_the_eyes_off_the_middle(places: Places, x: float, side: str) -> None:
    at = np.array([x, 50.0, 29.0])
    assert places.name(at) == f"{side}forehead"
    assert places.name(at, "eye") == f"{side}eyeball" and places.name(at, "brow") == f"{side}brow"
    assert places.name(at, "lash") == f"{side}lash"
    assert [places.name(at, m) for m in ("teeth", "gums", "tongue")] == ["teeth", "gums", "tongue"]
    assert places.name(at, "mouth") == "inside the mouth"


def test_what_lies_about_the_mouth_moves_with_it_and_what_lies_above_in_part() -> None:
    skin = plain.part("face", *plain.sheet((-5, 5), (-5, 5), 5.0))
    long = Places(plain.subject(skin), plain.line_of_lips(-127.2))
    assert long.down == pytest.approx(2.0) and long.apart == pytest.approx(63.6)
    assert long.name(np.array([0.0, -115.0, 44.0])) == "upper lip"
    assert long.name(np.array([0.0, -141.0, 43.0])) == "lower lip"
    assert long.name(np.array([0.0, -56.0, 52.0])) == "nose"  # 0.45 / 1.06 of the way to the lips
    assert long.name(np.array([35.0, 19.0, 24.0])) == "left brow"


def test_a_head_without_eyes_is_named_by_its_mouth_or_by_its_size() -> None:
    head = plain.subject(plain.part("face", *plain.sheet((-80, 120), (-40, 160), 20.0, 30.0)), eyes=None)
    mouth = plain.line_of_lips(-66.0, z=9.0)
    by_mouth = Places(head, mouth)
    assert by_mouth.apart == pytest.approx(70.0)
    np.testing.assert_allclose(by_mouth.centre, [0.0, -66.0 + 1.06 * 70.0, 9.0 - 0.4 * 70.0])
    assert by_mouth.name(np.add(mouth.middle, [0.0, 7.0, 5.0])) == "upper lip"
    by_size = Places(head, None)
    np.testing.assert_allclose(by_size.centre, [20.0, 80.0, 30.0 - 35.0])
    assert by_size.apart == pytest.approx(70.0) and by_size.down == pytest.approx(1.06)


def test_a_head_with_no_skin_or_with_eyes_in_one_place_has_places_all_the_same() -> None:
    assert Places(plain.subject(plain.eyeball(0), eyes=None), None).apart == pytest.approx(1e-6)
    assert Places(plain.subject(plain.eyeball(0), eyes=0.0 * plain.EYES), None).apart == pytest.approx(1e-6)
