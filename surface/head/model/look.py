"""Appearance of a person (look): skin, eyes, brows, and what is worn, apart from the shape of the head."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from surface.base.arrays import Floats, Floats32
from surface.head.model.data import HeadData, PartData

Colour = tuple[float, float, float]

#: Linear albedo of skin by its melanin, 0 very light to 1 very dark, and of the shipped head's own paint.
TONES = np.array(
    [
        (0.70, 0.485, 0.400),
        (0.60, 0.370, 0.280),
        (0.455, 0.252, 0.168),
        (0.300, 0.150, 0.092),
        (0.168, 0.081, 0.050),
        (0.082, 0.041, 0.028),
    ]
)
OWN_MELANIN = 0.2
#: Density that blood adds to skin by channel: haemoglobin absorbs green and blue, and hardly any red.
BLOOD = np.array((0.05, 0.34, 0.26))
_AGED = {"wrinkleForehead": 0.75, "wrinkleFrown": 0.50, "wrinkleEye": 0.80, "wrinkleCheek": 0.90}
"""Amount of a wrinkle at rest at the age of 1, by the beginning of its group's name."""
_FOREHEAD = "wrinkleForehead"  # with which the names of groups begin whose lines a look has in depths of its own
_APART = 2.5  # of the usual distance of a group's points in order: where they are further apart, another line begins


@dataclass(frozen=True)
class Worn:
    """A part that is put on a head: hair, a beard, a shirt.

    path : its file. colour : linear RGB. tips : of the ends of strands; None as ``colour``.
    gloss : strength of the highlights, 1 for ordinary hair or cloth.
    """

    path: Path
    colour: Colour
    tips: Colour | None = None
    gloss: float = 1.0


@dataclass(frozen=True)
class Look:
    """A person's appearance; colours are linear RGB, None to keep the head's own.

    melanin : 0 very light skin, 1 very dark; 0.2 is the shipped head's. None leaves the painted colours as they are.
    blood : density of blood under the skin against the usual, -1 pale to 1 ruddy.
    redness : how much lips, cheeks, nose and ears differ from the rest, 1 as painted.
    freckles : 0 none to 1 many.
    age : 0 young to 1 with deep wrinkles at rest.
    forehead : how deep raised brows fold each line of the forehead, the lowest first; 1 as the head has it.
    lips : colour of lips. iris, brow : colours. brow_strength : how dense brows are, 1 as they are.
    fold : how deep the folds of the upper lids are, and how high over their rims, 1 as the head has them.
    worn : what is put on the head.
    """

    melanin: float | None = None
    blood: float = 0.0
    redness: float = 1.0
    freckles: float = 0.0
    age: float = 0.0
    forehead: tuple[float, float, float] = (1.0, 1.0, 1.0)
    lips: Colour | None = None
    iris: Colour | None = None
    brow: Colour | None = None
    brow_strength: float = 1.0
    fold: tuple[float, float] = (1.0, 1.0)
    worn: tuple[Worn, ...] = ()


def skin_tone(melanin: float, blood: float = 0.0) -> Floats:
    """Return (3,): linear albedo of skin.

    Melanin and blood absorb: each adds to the density, the negative logarithm of the albedo (Tsumura, Ojima, Sato et
    al., "Image-based skin color and texture analysis/synthesis by extracting hemoglobin and melanin information in the
    skin", SIGGRAPH 2003). Between the tones of :data:`TONES` densities are linear.
    """
    at = np.linspace(0.0, 1.0, len(TONES))
    density = np.array([np.interp(melanin, at, -np.log(TONES[:, k])) for k in range(3)])
    return np.exp(-density - blood * BLOOD)


def skin_albedo(painted: Floats, melanin: float, blood: float, redness: Floats) -> Floats:
    """Return (m, 3): albedo of painted skin (m, 3) for another melanin.

    What the paint adds to the base tone, in density, stays: by ``redness (m, 1)``, and less in darker skin, whose
    melanin covers the blood.
    """
    own = np.log(np.maximum(painted, 1e-4) / skin_tone(OWN_MELANIN))
    covered = 1.0 - 0.45 * melanin
    return np.asarray(skin_tone(melanin, blood) * np.exp(covered * redness * own))


def with_age(head: HeadData, age: float) -> HeadData:
    """Return the head with its wrinkles at rest, each by its share of ``age``, 0..1."""
    shares = {
        group.name: age * share
        for part in head.parts
        for group in part.groups
        for start, share in _AGED.items()
        if age > 0.0 and group.name.startswith(start)
    }
    parts = []
    for part in head.parts:
        points = np.array(part.points)
        for group in part.groups:
            if share := shares.get(group.name, 0.0):
                np.add.at(points, group.ids, share * group.moves)
        parts.append(replace(part, points=points))
    return replace(head, parts=parts)


def with_forehead(head: HeadData, depths: tuple[float, ...]) -> HeadData:
    """Return the head with each line of its forehead as deep as ``depths`` say, the lowest first; lines above those
    that are named are as deep as the last one."""
    if set(depths) == {1.0}:
        return head
    return replace(head, parts=[_with_lines(part, depths) for part in head.parts])


def _with_lines(part: PartData, depths: tuple[float, ...]) -> PartData:
    groups = [
        replace(group, moves=_deepened(part.points[group.ids], group.moves, depths))
        if group.name.startswith(_FOREHEAD) and len(group.ids)
        else group
        for group in part.groups
    ]
    return replace(part, groups=groups)


def _deepened(points: Floats, moves: Floats32, depths: tuple[float, ...]) -> Floats32:
    """Return moves (k, 3) of points (k, 3), which follow each other along one line after the other, by line."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    usual = float(np.median(steps)) if len(steps) else 0.0
    line = np.concatenate([[0], np.cumsum(steps > _APART * usual)])
    height = np.array([points[line == k, 1].mean() for k in range(line[-1] + 1)])
    rank = np.argsort(np.argsort(height))
    share = np.array(depths)[np.minimum(rank, len(depths) - 1)]
    return np.asarray(share[line][:, None] * moves, np.float32)
