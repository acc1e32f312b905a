"""Names of places on a head, in words: "left mouth corner"."""

from __future__ import annotations

import numpy as np

from surface.base.arrays import Floats
from surface.check.mouth import Mouth
from surface.check.subject import Subject

# x outwards, y up, z forward from the middle between the eyes, in distances between the eyes (1 = 64 mm at usual size).
# y of what lies about the mouth is in distances from the eyes to the lips instead (1 = at the lips).
FACE = {
    "eye": (0.5, 0.0, 0.0), "brow": (0.55, 0.3, 0.2), "forehead": (0.2, 0.75, 0.25), "temple": (1.0, 0.35, -0.5),
    "nose": (0.0, -0.45, 0.65), "nostril": (0.16, -0.62, 0.45), "bridge of the nose": (0.0, 0.0, 0.3),
    "cheek": (0.72, -0.6, 0.05), "ear": (1.15, -0.35, -1.1),
    "mouth corner": (0.36, -1.0, 0.25), "upper lip": (0.0, -0.86, 0.5), "lower lip": (0.0, -1.12, 0.48),
    "chin": (0.0, -1.6, 0.35), "jaw": (0.75, -1.35, -0.35), "throat": (0.0, -2.1, -0.4), "neck": (0.6, -2.4, -0.9),
    "top of the head": (0.0, 1.4, -0.9), "back of the head": (0.0, 0.2, -2.3), "nape": (0.0, -1.5, -1.9),
    "side of the head": (1.2, 0.5, -1.2),
}  # fmt: skip
BY_LIPS = ("mouth corner", "upper lip", "lower lip", "chin", "jaw", "throat", "neck")
TO_LIPS = 1.06  # from the eyes to the lips on a usual head, in distances between the eyes
ASIDE = 0.12  # so far from the middle a place has a side
INNER = {"mouth": "inside the mouth", "teeth": "teeth", "gums": "gums", "tongue": "tongue", "eye": "eyeball"}


class Places:
    """Names places of one head.

    centre : (3,) between the eyes; apart : of the eyes, mm; down : from the eyes to the lips, in ``apart``.
    """

    def __init__(self, subject: Subject, mouth: Mouth | None) -> None:
        self.centre, self.apart = _eyes(subject, mouth)
        self.down = (self.centre[1] - mouth.middle[1]) / self.apart if mouth is not None else TO_LIPS
        self._names = list(FACE)
        self._at = np.array([self._stretched(n, self.down) for n in FACE])

    @staticmethod
    def _stretched(name: str, down: float) -> tuple[float, float, float]:
        x, y, z = FACE[name]
        return (x, y * down / (1.0 if name in BY_LIPS else TO_LIPS), z) if y < 0 else (x, y, z)

    def name(self, point: Floats, material: str = "skin") -> str:
        """Return the place of a point (3,) at rest, mm, on a part of a material."""
        x, y, z = (np.asarray(point, float) - self.centre) / self.apart
        side = "" if abs(x) < ASIDE else "left " if x > 0 else "right "
        if material in INNER:
            return side + INNER[material] if material == "eye" else INNER[material]
        if material in ("brow", "lash"):
            return f"{side}{material}"
        nearest = int(np.argmin(np.linalg.norm(self._at - [abs(x), y, z], axis=1)))
        return side + self._names[nearest]


def _eyes(subject: Subject, mouth: Mouth | None) -> tuple[Floats, float]:
    """Return (3,): the middle between the eyes, at the front of the eyeballs, and the distance between the eyes, mm."""
    if subject.eyes is not None:
        apart = max(float(np.linalg.norm(subject.eyes[0] - subject.eyes[1])), 1e-6)
        front = np.array([0.0, 0.0, subject.head.data.eye_radius])
        return subject.eyes.mean(axis=0) + front, apart
    at = np.concatenate([subject.rest[k] for k in subject.skin] or [np.zeros((2, 3))]).astype(np.float64)
    low, high = at.min(axis=0), at.max(axis=0)
    apart = max(0.35 * float(high[0] - low[0]), 1e-6)
    if mouth is not None:
        return mouth.middle + np.array([0.0, TO_LIPS, -0.4]) * apart, apart
    return np.array([0.5 * (low[0] + high[0]), low[1] + 0.6 * (high[1] - low[1]), high[2] - 0.5 * apart]), apart
