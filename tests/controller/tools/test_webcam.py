"""The face of a webcam: results as MediaPipe gives them become frames, and what is missing is told.

MediaPipe and a camera stand in as modules of the names that omote imports; neither is needed here.
"""

from __future__ import annotations

import math
import socket
import sys
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.base.errors import LinkError
from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.tools.webcam import _pictures, frame_of, send_webcam
from surface.base.errors import MissingPackage

JAW = P.index("jawOpen")


def result(matrix: np.ndarray | None = None, **shapes: float) -> Any:
    given = [SimpleNamespace(category_name=name, score=score) for name, score in {"_neutral": 0.9, **shapes}.items()]
    return SimpleNamespace(
        face_blendshapes=[given] if shapes else [], facial_transformation_matrixes=[] if matrix is None else [matrix]
    )


def turned(axis: int, angle_rad: float) -> np.ndarray:
    """A turn about an axis, right-handed."""
    matrix, (one, two) = np.eye(4), [(1, 2), (2, 0), (0, 1)][axis]
    matrix[one, one] = matrix[two, two] = math.cos(angle_rad)
    matrix[two, one], matrix[one, two] = math.sin(angle_rad), -math.sin(angle_rad)
    return matrix


def test_shapes_come_by_their_names() -> None:
    frame = frame_of(result(jawOpen=0.5, mouthSmileLeft=0.25, unheardOf=1.0, eyeBlinkLeft=math.nan), 1.5, P)
    assert frame.values[JAW] == 0.5 and frame.mask.sum() == 2 and frame.time_s == 1.5 and frame.face


def test_no_face_is_said() -> None:
    frame = frame_of(result(), 1.0, P)
    assert not frame.face and not frame.mask.any()


@pytest.mark.parametrize(
    ("name", "axis", "sign"),
    [
        ("headYaw", 1, 1.0),  # a turn about y takes the nose (z) to x, the image's right: the own left
        ("headPitch", 0, 1.0),  # a turn about x takes the nose down
        ("headRoll", 2, 1.0),  # a turn about z raises x, the own left side
    ],
)
def test_the_matrix_turns_the_head(name: str, axis: int, sign: float) -> None:
    angle_rad, at = 0.3, P.index(name)
    frame = frame_of(result(turned(axis, angle_rad), jawOpen=0.0), 0.0, P)
    assert frame.values[at] == pytest.approx(sign * angle_rad / P.full_scale_rad[at])
    others = [P.index(other) for other in ("headYaw", "headPitch", "headRoll") if other != name]
    np.testing.assert_allclose(frame.values[others], 0.0, atol=1e-12)


class Camera:
    """Gives three pictures."""

    def __init__(self, number: int) -> None:
        self.left, self.opened = 3, number == 0

    def isOpened(self) -> bool:
        return self.opened

    def read(self) -> tuple[bool, np.ndarray]:
        self.left -= 1
        return self.left >= 0, np.zeros((4, 4, 3), np.uint8)

    def release(self) -> None:
        self.opened = False


class Landmarker:
    """Sees a face in every picture but the second."""

    def __init__(self) -> None:
        self.times = list[int]()

    @classmethod
    def create_from_options(cls, options: Any) -> Landmarker:
        if options.base_options.model_asset_buffer != b"a model":
            raise RuntimeError("Unable to open zip archive.\nmore")
        assert options.output_face_blendshapes and options.output_facial_transformation_matrixes
        return cls()

    def detect_for_video(self, picture: Any, time_ms: int) -> Any:
        assert not self.times or time_ms > self.times[-1]
        self.times.append(time_ms)
        return result() if len(self.times) == 2 else result(np.eye(4), jawOpen=0.5)

    def close(self) -> None:
        pass


@pytest.fixture
def there(monkeypatch: pytest.MonkeyPatch) -> None:
    cv2: Any = ModuleType("cv2")
    cv2.VideoCapture, cv2.cvtColor, cv2.COLOR_BGR2RGB = Camera, lambda picture, code: picture[..., ::-1], 4
    mediapipe: Any = ModuleType("mediapipe")
    vision = SimpleNamespace(
        FaceLandmarkerOptions=SimpleNamespace, RunningMode=SimpleNamespace(VIDEO=1), FaceLandmarker=Landmarker
    )
    mediapipe.tasks = SimpleNamespace(vision=vision, BaseOptions=SimpleNamespace)
    mediapipe.Image, mediapipe.ImageFormat = SimpleNamespace, SimpleNamespace(SRGB=1)
    for module in (cv2, mediapipe):
        module.__spec__ = ModuleSpec(module.__name__, None)
        monkeypatch.setitem(sys.modules, module.__name__, module)


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "face_landmarker.task"
    path.write_bytes(b"a model")
    return path


@pytest.mark.usefixtures("there")
def test_pictures_become_messages(model: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10)
        seen = send_webcam(model, f"json:127.0.0.1:{receiver.getsockname()[1]}", P)
        decoder = FORMATS.get("json").decoder(P)
        frames = [frame for _ in range(3) for frame in decoder.feed(receiver.recv(65536))]
    assert (seen.frames, seen.faces, seen.sent) == (3, 2, 3)
    assert [frame.face for frame in frames] == [True, False, True] and frames[0].values[JAW] == 0.5


@pytest.mark.usefixtures("there")
def test_a_camera_that_is_not_there_is_told(model: Path) -> None:
    with pytest.raises(LinkError, match="camera 1 cannot be opened"):
        send_webcam(model, "json", P, camera=1)


@pytest.mark.usefixtures("there")
def test_a_model_that_is_none_is_told(model: Path) -> None:
    model.write_bytes(b"something else")
    with pytest.raises(LinkError, match=r"not a face landmarker of MediaPipe: Unable to open zip archive\.$") as caught:
        send_webcam(model, "json", P)
    assert "downloads nothing" in caught.value.hint


def test_a_model_that_is_not_there_is_told_before_anything_else(tmp_path: Path) -> None:
    with pytest.raises(LinkError, match=r"none\.task: cannot be read: No such file"):
        send_webcam(tmp_path / "none.task", "json", P)


def test_missing_packages_are_named_with_their_extra(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("surface.base.extras.find_spec", lambda name: None)
    with pytest.raises(MissingPackage, match="omote webcam needs the packages mediapipe and opencv") as caught:
        send_webcam(model, "json", P)
    assert "omote[webcam]" in caught.value.hint


def test_a_real_capture_gives_the_pictures_of_a_film(tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2", reason="needs OpenCV: pip install 'omote[webcam]'")
    path = str(tmp_path / "film.avi")
    writer = cv2.VideoWriter(path, cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (64, 48))
    for brightness in range(0, 200, 20):
        writer.write(np.full((48, 64, 3), brightness, np.uint8))
    writer.release()
    seen = list(_pictures(cv2.VideoCapture(path)))
    assert [round(float(each.mean()), -1) for each in seen] == list(range(0, 200, 20))
