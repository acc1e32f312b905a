"""Computes parameters from the 468 or 478 landmarks of MediaPipe's face mesh, by geometry.

Indices of landmarks and their positions at rest are from ``canonical_face_model.obj`` of google/mediapipe; 33 and 133
are the corners of the face's own right eye. The lids use the eye aspect ratio of Soukupova and Cech, "Real-Time Eye
Blink Detection using Facial Landmarks" (2016). Every other parameter uses a length in the face's own axes, in units of
the distance between the outer corners of the eyes (33 to 263): its difference from rest, divided by the difference of a
full movement. The full movements are chosen, not measured.
"""

from __future__ import annotations

import math

import numpy as np

from controller.base.parameters import Floats, Parameters

COUNTS = (468, 478)
"""Number of landmarks of a face, without and with the irises."""

_EYES = {"Right": (33, 160, 158, 133, 153, 144), "Left": (263, 387, 385, 362, 380, 373)}
_BROWS = {"Right": (107, 105), "Left": (336, 334)}
_CORNERS = {"Right": 61, "Left": 291}
_LIPS, _TOP, _CHIN = (13, 14), 10, 152

# Measures of a face at rest and of a full movement, in units of the distance between the outer corners of the eyes; the
# eye aspect ratios have no unit.
_RATIO_REST, _RATIO_SHUT, _RATIO_WIDE = 0.234, 0.08, 0.36
_GAP_REST, _GAP_OPEN = 0.062, 0.5
_WIDTH_REST, _WIDTH_STRETCH, _WIDTH_PUCKER = 0.552, 0.70, 0.35
_CORNER_REST, _CORNER_WHOLE = -0.008, 0.1
_INNER_REST, _OUTER_REST, _BROW_WHOLE = 0.269, 0.279, 0.08


def face_of(points: Floats, parameters: Parameters) -> dict[int, float]:
    """Return the values that landmarks show, by parameter index; an empty dict if the points are degenerate.

    points : (468, 3) or (478, 3) float64, in the same unit on all axes: x to the image's right, y down, z away from the
    camera.
    """
    turned = points * (1.0, -1.0, -1.0)
    axes = _axes(turned)
    if axes is None:
        return {}
    span = float(np.linalg.norm(turned[263] - turned[33]))
    aligned = turned @ axes / span
    named = _lids(aligned) | _mouth(aligned) | _brows(aligned)
    found = {parameters.index(name): min(max(value, 0.0), 1.0) for name, value in named.items()}
    return found | dict(zip(*head_angles(axes, parameters), strict=True))


def head_angles(turn: Floats, parameters: Parameters) -> tuple[list[int], list[float]]:
    """Return the parameter indices and values of the head's yaw, pitch and roll for a rotation.

    turn : (3, 3), whose columns point to the face's own left, up and forward, in axes to the image's right, up and
    towards the camera. It is taken as Ry(yaw) Rx(pitch) Rz(roll). The face looks at the camera, along +z, so the
    image's right, +x, is the face's own left. Yaw is positive to the face's own left, pitch downwards, and roll where
    its own left side rises.
    """
    yaw, pitch = math.atan2(turn[0, 2], turn[2, 2]), math.asin(min(max(-turn[1, 2], -1.0), 1.0))
    roll = math.atan2(turn[1, 0], turn[1, 1])
    indices = [parameters.index(name) for name in ("headYaw", "headPitch", "headRoll")]
    angles = np.clip(np.array([yaw, pitch, roll]) / parameters.full_scale_rad[indices], -1.0, 1.0)
    return indices, angles.tolist()


def _axes(points: Floats) -> Floats | None:
    """Return (3, 3), columns to the face's own left, up and forward; None if the points are degenerate."""
    left, up = points[263] - points[33], points[_TOP] - points[_CHIN]
    forward = np.cross(left, up)
    lengths = float(np.linalg.norm(left)), float(np.linalg.norm(forward))
    if not min(lengths) > 1e-9 or not all(map(math.isfinite, lengths)):
        return None
    left, forward = left / lengths[0], forward / lengths[1]
    return np.stack([left, np.cross(forward, left), forward], axis=1)


def _lids(aligned: Floats) -> dict[str, float]:
    found = {}
    for side, (outer, up_1, up_2, inner, low_2, low_1) in _EYES.items():
        gaps = np.linalg.norm(aligned[up_1] - aligned[low_1]) + np.linalg.norm(aligned[up_2] - aligned[low_2])
        ratio = float(gaps) / max(2.0 * float(np.linalg.norm(aligned[outer] - aligned[inner])), 1e-9)
        found[f"eyeBlink{side}"] = (_RATIO_REST - ratio) / (_RATIO_REST - _RATIO_SHUT)
        found[f"eyeWide{side}"] = (ratio - _RATIO_REST) / (_RATIO_WIDE - _RATIO_REST)
    return found


def _mouth(aligned: Floats) -> dict[str, float]:
    upper, lower = aligned[_LIPS[0]], aligned[_LIPS[1]]
    middle, width = (upper[1] + lower[1]) / 2.0, aligned[_CORNERS["Left"]][0] - aligned[_CORNERS["Right"]][0]
    gap = float(np.linalg.norm(upper - lower))
    found = {
        "jawOpen": (gap - _GAP_REST) / (_GAP_OPEN - _GAP_REST),
        "mouthPucker": (_WIDTH_REST - width) / (_WIDTH_REST - _WIDTH_PUCKER),
    }
    for side, corner in _CORNERS.items():
        lifted = (aligned[corner][1] - middle - _CORNER_REST) / _CORNER_WHOLE
        found |= {f"mouthSmile{side}": lifted, f"mouthFrown{side}": -lifted}
        found[f"mouthStretch{side}"] = (width - _WIDTH_REST) / (_WIDTH_STRETCH - _WIDTH_REST)
    return found


def _brows(aligned: Floats) -> dict[str, float]:
    found, inner_up = {}, 0.0
    for side, (inner, outer) in _BROWS.items():
        eye = (aligned[_EYES[side][0]][1] + aligned[_EYES[side][3]][1]) / 2.0
        lifted = (aligned[inner][1] - eye - _INNER_REST) / _BROW_WHOLE
        inner_up += lifted / 2.0
        found[f"browDown{side}"] = -lifted
        found[f"browOuterUp{side}"] = (aligned[outer][1] - eye - _OUTER_REST) / _BROW_WHOLE
    return found | {"browInnerUp": inner_up}
