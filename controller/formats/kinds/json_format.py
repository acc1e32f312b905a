"""JSON: an object for each message, with parameters by name.

``{"type": "set", "parameters": {"jawOpen": 0.5}}`` and plain ``{"jawOpen": 0.5}`` are the same; ``null`` releases a
parameter, and what is not named stays as it was; ``"to"`` names the head or group of heads that is meant.
Blend shapes as MediaPipe's face landmarker gives them are read, too:
``[{"categoryName": "jawOpen", "score": 0.5}, ...]``, and so are its landmarks, by :mod:`controller.formats.landmarks`;
of a result with both, the shapes count and the landmarks turn the head. The encoder adds ``"measured"``, what the
servos show, where it is given.
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
_MOST_HEADS = 512
"""Heads and groups whose values are kept; a stranger cannot name more."""
_LISTS = ("blendshapes", "categories", "faceBlendshapes", "face_blendshapes")
_POINTS = ("faceLandmarks", "face_landmarks", "multiFaceLandmarks", "multi_face_landmarks", "landmarks", "landmark")
_ANGLES = ("headYaw", "headPitch", "headRoll")
_ASPECT = 4 / 3
"""Width over height of a picture that names no ``"width"`` and ``"height"``."""


class JsonDecoder:
    """Reads objects; what is wrong in one is counted, and the rest of it is taken."""

    def __init__(self, parameters: Parameters) -> None:
        self.refused = Refusals()
        self._parameters, self._held = parameters, Held(parameters)
        self._heads = {"": self._held}

    def feed(self, message: bytes) -> list[Frame]:
        """One frame for each object that gives or releases something."""
        try:
            found = json.loads(message)
        except (ValueError, RecursionError):
            self.refused.add("not JSON")
            return []
        return self.read(found)

    def read(self, found: Any) -> list[Frame]:
        """As :meth:`feed`, of a message that was parsed before."""
        table = {_key_of(found): found} if isinstance(found, list) else found
        if not isinstance(table, dict) or table.get("type", "set") not in _KINDS:
            self.refused.add("no object that sets parameters")
            return []
        to = table["to"][:64] if isinstance(table.get("to"), str) else ""
        if table.get("face") is False or (isinstance(found, dict) and _is_empty(table)):
            return [Frame(self._parameters.neutral(), np.zeros(len(self._parameters), dtype=bool), face=False, to=to)]
        if not self._choose(to):
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

    def _choose(self, to: str) -> bool:
        """Let the next values be those of a head; False where too many were named."""
        if to not in self._heads:
            if len(self._heads) >= _MOST_HEADS:
                self.refused.add("too many heads")
                return False
            self._heads[to] = Held(self._parameters)
        self._held = self._heads[to]
        return True

    def _given(self, table: dict[str, Any]) -> Iterator[tuple[str, Any]]:
        """Names and values, wherever in the object they stand."""
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
        """Take what landmarks show, or the head's angles alone; names of what that changed."""
        listed = next((table[key] for key in _POINTS if isinstance(table.get(key), list)), None)
        if listed is None:
            return []
        points = _points(listed, table)
        found = {} if points is None else face_of(points, self._parameters)
        if not found:
            self.refused.add("landmarks that are no face of 468 or 478 points")
        kept = {self._parameters.names[at]: (at, value) for at, value in found.items()}
        names = [name for name in kept if not angles_only or name in _ANGLES]
        self._held.update(dict(kept[name] for name in names))
        return names

    def _take(self, name: str, value: Any) -> bool:
        """Take one value; whether that changed anything."""
        if name in _SKIPPED:
            return False
        at = self._parameters.find(name)
        if at is None:
            self.refused.add("unknown names")
        elif value is None:
            self._held.mask[at] = False
            return True
        elif is_number(value):
            self._held.update({at: float(value)})
            return True
        else:
            self.refused.add("values that are no numbers")
        return False


class JsonEncoder:
    """Writes one object for each frame, without blanks; what was given before and is not any more is ``null``."""

    def __init__(self, parameters: Parameters) -> None:
        self._names = parameters.names
        self._once = np.zeros(len(parameters), dtype=bool)

    def encode(self, frame: Frame) -> list[bytes]:
        """One message; values have six digits after the point."""
        table: dict[str, Any] = {"type": "set"}
        if frame.time_s is not None:
            table["time"] = round(frame.time_s, 6)
        if not frame.face:
            table["face"] = False
        gone = np.flatnonzero(self._once & ~frame.mask)
        self._once |= frame.mask
        table["parameters"] = self._named(frame.values, frame.mask) | {self._names[i]: None for i in gone}
        if frame.measured is not None:
            table["measured"] = self._named(frame.measured, frame.mask)
        return [json.dumps(table, separators=(",", ":")).encode()]

    def _named(self, values: Floats, mask: Flags) -> dict[str, float]:
        given = zip(self._names, values.tolist(), mask.tolist(), strict=True)
        return {name: round(value, 6) for name, value, held in given if held}


def _key_of(found: list[Any]) -> str:
    """Whether a list is of landmarks or of shapes."""
    first = found[0] if found else None
    while isinstance(first, list) and first and not is_number(first[0]):
        first = first[0]
    return "landmarks" if isinstance(first, list) or (isinstance(first, dict) and "x" in first) else "blendshapes"


def _is_empty(table: dict[str, Any]) -> bool:
    """Whether a result of a tracker says that it sees no face."""
    given = [table[key] for key in (*_LISTS, *_POINTS) if key in table]
    return bool(given) and all(each == [] for each in given)


def _points(listed: list[Any], table: dict[str, Any]) -> Floats | None:
    """(n, 3) points of the first face, in one unit for all axes; None where they are not 468 or 478 triples."""
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
    if np.abs(points[:, :2]).max() <= 4.0:  # shares of the picture, not pixels; z has the unit of x
        points[:, 1] /= _aspect(table.get("width"), table.get("height"))
    return points


def _aspect(width: Any, height: Any) -> float:
    """Width over height of the picture."""
    if is_number(width) and is_number(height) and 1.0 <= width <= 1e6 and 1.0 <= height <= 1e6:
        return width / height
    return _ASPECT


def is_number(value: Any) -> TypeGuard[float]:
    """Whether a value is a finite number that fits into 64 bits of a float."""
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
