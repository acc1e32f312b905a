"""Sends the face that a webcam sees, as MediaPipe's face landmarker detects it with a model file (the extra webcam).

MediaPipe gives ARKit's shapes by name (without ``tongueOut``) and a 4 x 4 matrix of the head, in metres or centimetres,
whose axes are x to the image's right, y up and z towards the camera. Source: the documentation of its face landmarker.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from controller.base.errors import LinkError
from controller.base.parameters import Parameters
from controller.formats.frame import Frame
from controller.formats.landmarks import head_angles
from controller.links.net.senders import open_sender
from controller.tools.translate import parse_end
from surface.base import files
from surface.base.extras import importing

_MAX_MODEL_BYTES = 256 << 20
_MODEL_HINT = "give the path of face_landmarker.task, which MediaPipe's documentation names; omote downloads nothing"


@dataclass
class Seen:
    """Counts of a run. frames : pictures of the camera. faces : pictures with a face. sent : messages sent."""

    frames: int = 0
    faces: int = 0
    sent: int = 0


def send_webcam(
    model: Path,
    target: str,
    parameters: Parameters,
    *,
    camera: int = 0,
    seconds: float | None = None,
    ready: Callable[[str], None] = lambda text: None,
) -> Seen:
    """Send faces until the time is over or the camera ends; Ctrl-C raises KeyboardInterrupt.

    model : file of MediaPipe's face landmarker. target : ``kind:address``, as of ``omote translate``.
    ready : called with a message when the camera and the target are open.

    Raises MissingPackage: the extra is not installed. LinkError: the model, the camera or the target cannot be used.
    PluginError: no such kind.
    """
    with files.reading(model, LinkError, hint=_MODEL_HINT), files.open_file(model, _MAX_MODEL_BYTES) as file:
        content = file.read()
    form, address = parse_end(target)
    with ExitStack() as closers:
        results = _detect_faces(content, camera, closers)
        sender = open_sender(address, form.delimiter)
        closers.callback(sender.close)
        ready(f"sending the face that camera {camera} sees to {form.kind} at {address}")
        seen, encoder, end_s = Seen(), form.encoder(parameters), time.monotonic() + (seconds or math.inf)
        for time_s, result in results:
            frame = frame_of(result, time_s, parameters)
            seen.frames, seen.faces = seen.frames + 1, seen.faces + frame.face
            seen.sent += sum([sender.send(message) for message in encoder.encode(frame)])
            if time.monotonic() >= end_s:
                break
    return seen


def frame_of(result: Any, time_s: float, parameters: Parameters) -> Frame:
    """Convert a result of the face landmarker to a frame; without a face, the frame has ``face=False``."""
    values, mask = parameters.neutral(), np.zeros(len(parameters), dtype=bool)
    if not result.face_blendshapes:
        return Frame(values, mask, time_s, face=False)
    for shape in result.face_blendshapes[0]:
        i = parameters.find(shape.category_name)
        if i is not None and math.isfinite(shape.score):
            values[i], mask[i] = shape.score, True
    matrices = result.facial_transformation_matrixes
    if matrices:
        head, angles = head_angles(np.asarray(matrices[0], dtype=np.float64), parameters)
        values[head], mask[head] = angles, True
    return Frame(values, mask, time_s)


def _detect_faces(model: bytes, camera: int, closers: ExitStack) -> Iterator[tuple[float, Any]]:
    """Open the camera; return an iterator over the time (s) and the landmarker's result of each picture."""
    with importing("omote webcam", "mediapipe", "cv2"):
        import cv2  # optional: the extra webcam
        import mediapipe as mp
    landmarker = _landmarker(mp, model)
    closers.callback(landmarker.close)
    capture = cv2.VideoCapture(camera)
    closers.callback(capture.release)
    if not capture.isOpened():
        raise LinkError(f"camera {camera} cannot be opened", hint="try another number: --camera 1; ls /dev/video*")
    return _run_detector(_pictures(capture), lambda picture, ms: landmarker.detect_for_video(
        mp.Image(image_format=mp.ImageFormat.SRGB, data=cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)), ms))  # fmt: skip


def _landmarker(mp: Any, model: bytes) -> Any:
    tasks = mp.tasks
    options = tasks.vision.FaceLandmarkerOptions(
        base_options=tasks.BaseOptions(model_asset_buffer=model),
        running_mode=tasks.vision.RunningMode.VIDEO,
        output_face_blendshapes=True,
        output_facial_transformation_matrixes=True,
    )
    try:
        return tasks.vision.FaceLandmarker.create_from_options(options)
    except (RuntimeError, ValueError) as error:
        why = str(error).splitlines()[0][:200]
        raise LinkError(f"the model is not a face landmarker of MediaPipe: {why}", hint=_MODEL_HINT) from error


def _pictures(capture: Any) -> Iterator[Any]:
    while True:
        good, picture = capture.read()
        if not good:
            return
        yield picture


def _run_detector(pictures: Iterable[Any], detect: Callable[[Any, int], Any]) -> Iterator[tuple[float, Any]]:
    begin_s, last_ms = time.monotonic(), -1
    for picture in pictures:
        time_s = time.monotonic() - begin_s
        last_ms = max(last_ms + 1, int(1e3 * time_s))  # MediaPipe demands strictly ascending times
        yield time_s, detect(picture, last_ms)
