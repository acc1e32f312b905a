"""Parameters from landmarks of a face in its own axes, moved and turned by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.landmarks import face_of

REST = {
    33: (-4.446, 2.664, 3.173), 133: (-1.856, 2.585, 3.758), 160: (-3.670, 2.928, 3.724), 144: (-3.670, 2.360, 3.635),
    158: (-2.724, 2.962, 3.872), 153: (-2.724, 2.316, 3.777), 107: (-1.396, 5.012, 5.316), 105: (-3.987, 5.109, 4.466),
    61: (-2.456, -4.343, 4.284), 13: (0, -3.994, 5.219), 14: (0, -4.542, 5.405), 10: (0, 8.262, 4.482),
    152: (0, -9.403, 4.264),
}  # fmt: skip
"""Places of the canonical face model (cm): x to the face's own left, y up, z forward."""
MIRRORED = {33: 263, 133: 362, 160: 387, 144: 373, 158: 385, 153: 380, 107: 336, 105: 334, 61: 291}


def points(**moved: tuple[float, float, float]) -> np.ndarray:
    """(478, 3) landmarks, some of them moved: ``p14=(x, y, z)``."""
    found = np.zeros((478, 3))
    for at, place in REST.items():
        found[at] = place
        if at in MIRRORED:
            found[MIRRORED[at]] = -place[0], place[1], place[2]
    for name, by in moved.items():
        found[int(name[1:])] += by
    return found


def shown(own: np.ndarray) -> dict[str, float]:
    """What is found in the image of such a face, by name."""
    return {P.names[at]: value for at, value in face_of(own * (1.0, -1.0, -1.0), P).items()}


def test_the_canonical_face_is_at_rest() -> None:
    for name, value in shown(points()).items():
        assert value == pytest.approx(0.0, abs=0.05), name


@pytest.mark.parametrize(
    ("moved", "name"),
    [
        ({"p14": (0, -2.0, 0)}, "jawOpen"),
        ({"p387": (0, -0.5, 0), "p385": (0, -0.6, 0)}, "eyeBlinkLeft"),
        ({"p160": (0, 0.3, 0), "p158": (0, 0.3, 0)}, "eyeWideRight"),
        ({"p291": (0, 0.6, 0)}, "mouthSmileLeft"),
        ({"p61": (0, -0.6, 0)}, "mouthFrownRight"),
        ({"p61": (0.7, 0, 0), "p291": (-0.7, 0, 0)}, "mouthPucker"),
        ({"p107": (0, 0.5, 0), "p336": (0, 0.5, 0)}, "browInnerUp"),
        ({"p107": (0, -0.5, 0)}, "browDownRight"),
        ({"p334": (0, 0.5, 0)}, "browOuterUpLeft"),
    ],
)
def test_what_moves_is_found_on_its_side(moved: dict[str, tuple[float, float, float]], name: str) -> None:
    found = shown(points(**moved))
    assert found[name] > 0.4
    other = name.replace("Left", "?").replace("Right", "Left").replace("?", "Right")
    assert other == name or found[other] < 0.1


@pytest.mark.parametrize(
    ("axis", "name"), [((0.0, 1.0, 0.0), "headYaw"), ((1.0, 0.0, 0.0), "headPitch"), ((0.0, 0.0, 1.0), "headRoll")]
)
def test_the_head_turns_and_the_face_stays(axis: tuple[float, float, float], name: str) -> None:
    angle, (x, y, z) = 0.3, axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    found = shown(7.0 * points(p14=(0, -2.0, 0)) @ turn.T + (3.0, -40.0, 90.0))
    expected = angle / float(P.full_scale_rad[P.index(name)])
    for each in ("headYaw", "headPitch", "headRoll"):
        assert found[each] == pytest.approx(expected if each == name else 0.0, abs=0.03)
    assert found["jawOpen"] == pytest.approx(shown(points(p14=(0, -2.0, 0)))["jawOpen"], abs=1e-6)


@pytest.mark.parametrize("wrong", [np.zeros((468, 3)), np.full((468, 3), 1e14)])
def test_points_in_one_place_are_no_face(wrong: np.ndarray) -> None:
    assert face_of(wrong, P) == {}
