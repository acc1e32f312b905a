"""An independent face detector, Viola and Jones' cascades out of OpenCV's wheel, sees a face in the picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from surface.head import Head
from surface.view.pictures.offscreen import Offscreen
from surface.view.scene.camera import Camera

cv2 = pytest.importorskip("cv2", reason="the detector: pip install 'opencv-python-headless<5'")
SIZE = 480
SMILE = {"mouthSmileLeft": 0.9, "mouthSmileRight": 0.9, "cheekSquintLeft": 0.4, "cheekSquintRight": 0.4}
BLINK = {"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0}


def cascade(name: str):
    found = cv2.CascadeClassifier(str(Path(cv2.data.haarcascades) / f"haarcascade_{name}.xml"))
    assert not found.empty()
    return found


def faces(picture: np.ndarray) -> list[list[int]]:
    """x, y, width, height of every face found."""
    return [f.tolist() for f in np.reshape(cascade("frontalface_default").detectMultiScale(picture, 1.05, 4), (-1, 4))]


def eyes(picture: np.ndarray, face: list[int]) -> list[list[float]]:
    """Middles of eyes found in the upper part of a face."""
    x, y, w, h = face
    upper = picture[y : y + int(0.6 * h), x : x + w]
    found = np.reshape(cascade("eye").detectMultiScale(upper, 1.03, 4, minSize=(w // 10, w // 10)), (-1, 4))
    return [[x + a + 0.5 * c, y + b + 0.5 * d] for a, b, c, d in found.tolist()]


@pytest.fixture(scope="module")
def head(root: Path) -> Head:
    return Head.load(root / "configs" / "heads" / "ict")


@pytest.fixture(scope="module")
def screen(gl: None, head: Head):
    with Offscreen(head, (SIZE, SIZE), quality="fast") as made:
        yield made


def drawn(screen: Offscreen, head: Head, pose: dict[str, float], camera: Camera) -> np.ndarray:
    return cv2.cvtColor(np.ascontiguousarray(screen.render(head.values(pose), camera)[..., :3]), cv2.COLOR_RGB2GRAY)


def on_picture(camera: Camera, point: np.ndarray) -> np.ndarray:
    """Pixel of a place in the head."""
    at = np.asarray(camera.matrix(1.0), float) @ [*point, 1.0]
    return SIZE * np.array([0.5 + 0.5 * at[0] / at[3], 0.5 - 0.5 * at[1] / at[3]])


@pytest.mark.parametrize("pose", [{}, SMILE, {"jawOpen": 0.7}], ids=["neutral", "smile", "jawOpen"])
def test_the_face_and_both_eyes_are_found_where_they_are(screen: Offscreen, head: Head, pose: dict[str, float]) -> None:
    camera = Camera.front()
    picture = drawn(screen, head, pose, camera)
    wanted = [on_picture(camera, eye) for eye in head.data.eyes]
    good = [f for f in faces(picture) if all(f[0] < x < f[0] + f[2] and f[1] < y < f[1] + f[3] for x, y in wanted)]
    assert good, faces(picture)
    found = np.array(eyes(picture, max(good, key=lambda f: f[2])))
    assert len(found), good
    apart = float(np.linalg.norm(wanted[0] - wanted[1]))
    assert max(np.linalg.norm(found - eye, axis=1).min() for eye in wanted) < 0.3 * apart


def test_the_face_is_found_with_its_eyes_shut(screen: Offscreen, head: Head) -> None:
    assert faces(drawn(screen, head, BLINK, Camera.front()))


def test_no_face_is_found_from_behind(screen: Offscreen, head: Head) -> None:
    assert not faces(drawn(screen, head, {}, Camera.around(180.0)))
