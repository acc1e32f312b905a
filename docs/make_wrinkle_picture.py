"""Draws docs/pictures/picture-wrinkles.webp: expressions without and with the control points that were put in for
wrinkles. ``python docs/make_wrinkle_picture.py [HEAD]``."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from controller.base.paths import find_config
from surface.head import Head
from surface.head.model.data import Group, HeadData, PartData
from surface.head.model.file import load_data
from surface.view import Camera, Offscreen, compose
from surface.view.pictures.imagefile import as_image, replacing

OUT = Path(__file__).parent / "pictures" / "picture-wrinkles.webp"
SIZE = (400, 300)
BOTH = ("Left", "Right")
VIEWS = {
    "forehead": (
        {"browInnerUp": 1.0, **{f"browOuterUp{s}": 1.0 for s in BOTH}},
        Camera.around(18, 6, distance=950, target=(4, 72, 80), fov_deg=7),
    ),
    "crow's feet": (
        {f"{n}{s}": v for n, v in (("mouthSmile", 0.9), ("cheekSquint", 1.0), ("eyeSquint", 0.5)) for s in BOTH},
        Camera.around(52, 4, distance=950, target=(50, 32, 60), fov_deg=4.5),
    ),
    "nasolabial folds": (
        {f"{n}{s}": v for n, v in (("mouthSmile", 1.0), ("cheekSquint", 0.6)) for s in BOTH},
        Camera.around(20, 4, distance=950, target=(6, -16, 85), fov_deg=5.5),
    ),
}


def without_wrinkles(head: HeadData) -> HeadData:
    """The head without the control points that only wrinkles need."""
    return replace(head, parts=[_plain(p) for p in head.parts], rules=[r for r in head.rules if not _folds(r.group)])


def _folds(name: str) -> bool:
    return name.startswith("wrinkle")


def _plain(part: PartData) -> PartData:
    inserted = [g.ids for g in part.groups if _folds(g.name)]
    if not inserted:
        return part
    keep = np.ones(len(part.points), bool)
    keep[np.concatenate(inserted)] = False
    number = np.cumsum(keep) - 1
    groups = [
        Group(g.name, number[g.ids[keep[g.ids]]].astype(np.int32), g.moves[keep[g.ids]])
        for g in part.groups
        if not _folds(g.name)
    ]
    arrays = ("points", "weights", "knots_u", "knots_v", "degrees", "jaw", "lids")
    return replace(part, groups=groups, mesh={}, **{a: getattr(part, a)[keep] for a in arrays})


def pictures(head: Head) -> list[np.ndarray]:
    """Every view of a head."""
    with Offscreen(head, SIZE) as screen:
        return [screen.render(head.values(pose), camera) for pose, camera in VIEWS.values()]


def main() -> None:
    """Draw and write."""
    data = load_data(sys.argv[1] if len(sys.argv) > 1 else find_config("heads", "ict"))
    labels = [f"{name}, {word}" for word in ("without", "with") for name in VIEWS]
    plain, full = pictures(Head(without_wrinkles(data))), pictures(Head(data))
    with replacing(OUT) as temporary:
        picture = np.asarray(compose([*plain, *full], labels, columns=len(VIEWS)))
        as_image(picture).save(temporary, format="WEBP", quality=85, method=6)


if __name__ == "__main__":
    main()
