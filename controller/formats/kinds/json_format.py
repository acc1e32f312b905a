"""Format JSON: one object per message, with parameters by name.

``{"type": "set", "parameters": {"jawOpen": 0.5}}`` and plain ``{"jawOpen": 0.5}`` mean the same. ``null`` releases a
parameter, one that is not named keeps its value, and ``"to"`` names the head or group of heads that is meant.
The decoder also reads results of MediaPipe's face landmarker: blend shapes
``[{"categoryName": "jawOpen", "score": 0.5}, ...]``, and landmarks, by :mod:`controller.formats.landmarks`. If a result
has both, only the angles of the head are taken from the landmarks. The encoder adds ``"measured"``, the face that the
servos show, if a frame has it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any, TypeGuard

import numpy as np

from controller.base.parameters import Flags, Floats, Parameters
from controller.formats.format import API, Format, everything
from controller.formats.frame import Frame, Held, Refusals
from controller.formats.landmarks import COUNTS, face_of

_KINDS = ("set", "state")
_SKIPPED = {"_neutral", "time", "type", "face", "subject", "to"}
_MAX_HEADS = 512
"""Greatest number of heads and groups whose values are kept, whatever a sender names."""
_LISTS = ("blendshapes", "categories", "faceBlendshapes", "face_blendshapes")
_POINTS = ("faceLandmarks", "face_landmarks", "multiFaceLandmarks", "multi_face_landmarks", "landmarks", "landmark")
_ANGLES = ("headYaw", "headPitch", "headRoll")
_ASPECT = 4 / 3
"""Width over height of a picture that names no ``"width"`` and ``"height"``."""


class JsonDecoder:
    """Decodes objects; an invalid entry is counted, and the other entries of the object are used."""

    def __init__(self, parameters: Parameters) -> None:
        self.refused = Refusals()
        self._parameters, self._held = parameters, Held(parameters)
        self._heads = {"": self._held}

    def feed(self, message: bytes) -> list[Frame]:
        """Return one frame for an object that sets or releases a parameter, else none."""
        try:
            found = json.loads(message)
        except (ValueError, RecursionError):
            self.refused.add("not JSON")
            return []
        return self.read(found)

    def read(self, found: Any) -> list[Frame]:
        """Return the same as :meth:`feed` for a message that is parsed already."""
        table = {_key_of(found): found} if isinstance(found, list) else found
        if not isinstance(table, dict) or table.get("type", "set") not in _KINDS:
            self.refused.add("no object that sets parameters")
            return []
        to = table["to"][:64] if isinstance(table.get("to"), str) else ""
        if table.get("face") is False or (isinstance(found, dict) and _is_empty(table)):
            return [Frame(self._parameters.neutral(), np.zeros(len(self._parameters), dtype=bool), face=False, to=to)]
        if not self._select_head(to):
            return []
        shapes = [name for name, value in self._given(table) if self._take(name, value)]
        if not shapes + self._take_points(table, angles_only=bool(shapes)):
            return []
        subject, time_s = table.get("subject"), table.get("time")
        return [
            self._held.frame(
                face=bool(self._held.mask.any()),
                time_s=float(time_s) if is_number(time_s) else None,
                subject=subject[:200] if isinstance(subject, str) else "",
                to=to,
            )
        ]

    def _select_head(self, to: str) -> bool:
        """Store the next values for a head; return False if too many heads were named."""
        if to not in self._heads:
            if len(self._heads) >= _MAX_HEADS:
                self.refused.add("too many heads")
                return False
            self._heads[to] = Held(self._parameters)
        self._held = self._heads[to]
        return True

    def _given(self, table: dict[str, Any]) -> Iterator[tuple[str, Any]]:
        """Yield names and values from wherever they are in the object."""
        listed = next((table[key] for key in _LISTS if isinstance(table.get(key), list)), None)
        if listed is not None:
            inside = (
                listed[0].get("categories") if listed and isinstance(listed[0], dict) else None
            )  # of the first face
            for each in inside if isinstance(inside, list) else listed:
                if isinstance(each, dict):
                    yield str(each.get("categoryName", each.get("category_name"))), each.get("score")
            return
        if any(key in table for key in _POINTS):
            return
        inner = table.get("parameters", table)
        yield from inner.items() if isinstance(inner, dict) else ()

    def _take_points(self, table: dict[str, Any], *, angles_only: bool) -> list[str]:
        """Store the values that landmarks show, or only the head's angles; return the names of those parameters."""
        listed = next((table[key] for key in _POINTS if isinstance(table.get(key), list)), None)
        if listed is None:
            return []
        points = _points(listed, table)
        found = {} if points is None else face_of(points, self._parameters)
        if not found:
            self.refused.add("landmarks that are not a face of 468 or 478 points")
        by_name = {self._parameters.names[index]: (index, value) for index, value in found.items()}
        names = [name for name in by_name if not angles_only or name in _ANGLES]
        self._held.update(dict(by_name[name] for name in names))
        return names

    def _take(self, name: str, value: Any) -> bool:
        """Set or release a parameter; return whether name and value are valid."""
        if name in _SKIPPED:
            return False
        index = self._parameters.find(name)
        if index is None:
            self.refused.add("unknown names")
        elif value is None:
            self._held.mask[index] = False
            return True
        elif is_number(value):
            self._held.update({index: float(value)})
            return True
        else:
            self.refused.add("values that are not numbers")
        return False


class JsonEncoder:
    """Encodes each frame as one object without spaces; parameters that are no longer given are ``null``."""

    def __init__(self, parameters: Parameters) -> None:
        self._names = parameters.names
        self._given_before = np.zeros(len(parameters), dtype=bool)

    def encode(self, frame: Frame) -> list[bytes]:
        """Return one message; values have six decimal places."""
        table: dict[str, Any] = {"type": "set"}
        if frame.time_s is not None:
            table["time"] = round(frame.time_s, 6)
        if not frame.face:
            table["face"] = False
        released = np.flatnonzero(self._given_before & ~frame.mask)
        self._given_before |= frame.mask
        table["parameters"] = self._named(frame.values, frame.mask) | {self._names[i]: None for i in released}
        if frame.measured is not None:
            table["measured"] = self._named(frame.measured, frame.mask)
        return [json.dumps(table, separators=(",", ":")).encode()]

    def _named(self, values: Floats, mask: Flags) -> dict[str, float]:
        given = zip(self._names, values.tolist(), mask.tolist(), strict=True)
        return {name: round(value, 6) for name, value, held in given if held}


def _key_of(found: list[Any]) -> str:
    """Return the key, "landmarks" or "blendshapes", for what a list contains."""
    first = found[0] if found else None
    while isinstance(first, list) and first and not is_number(first[0]):
        first = first[0]
    return "landmarks" if isinstance(first, list) or (isinstance(first, dict) and "x" in first) else "blendshapes"


def _is_empty(table: dict[str, Any]) -> bool:
    """Whether a tracker's result reports that it sees no face."""
    given = [table[key] for key in (*_LISTS, *_POINTS) if key in table]
    return bool(given) and all(each == [] for each in given)


def _points(listed: list[Any], table: dict[str, Any]) -> Floats | None:
    """Return (n, 3) points of the first face, in one unit for all axes; None if they are not 468 or 478 triples."""
    if len(listed) not in COUNTS:
        first = listed[0] if listed else None
        inside = first.get("landmark", first.get("landmarks")) if isinstance(first, dict) else first
        if not isinstance(inside, list) or len(inside) not in COUNTS:
            return None
        listed = inside
    rows = [[each.get(axis) for axis in "xyz"] if isinstance(each, dict) else each for each in listed]
    if not all(isinstance(row, list) and len(row) == 3 and all(map(is_number, row)) for row in rows):
        return None
    points = np.array(rows, dtype=np.float64)
    if np.abs(points[:, :2]).max() <= 4.0:  # fractions of the picture, not pixels; z has the unit of x
        points[:, 1] /= _aspect(table.get("width"), table.get("height"))
    return points


def _aspect(width: Any, height: Any) -> float:
    """Return the width of the picture divided by its height."""
    if is_number(width) and is_number(height) and 1.0 <= width <= 1e6 and 1.0 <= height <= 1e6:
        return width / height
    return _ASPECT


def is_number(value: Any) -> TypeGuard[float]:
    """Whether a value is a finite number below 1e15."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return abs(value) < 1e15 and math.isfinite(value)


FORMAT = Format(
    api=API,
    kind="json",
    title="JSON, an object a message",
    transports=("udp", "tcp", "serial", "lines"),
    port=9400,
    decoder=JsonDecoder,
    encoder=JsonEncoder,
    carries=everything,
    delimiter=b"\n",
    timeout_s=math.inf,
    takes_token=True,
    measured=True,
)
