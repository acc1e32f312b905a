"""Shape names of other heads, as ARKit's 52."""

from __future__ import annotations

from surface.head.parameters import SHAPES

MERGED = {"browInnerUp": ("browInnerUp_L", "browInnerUp_R"), "cheekPuff": ("cheekPuff_L", "cheekPuff_R")}
SIDES = {"_L": "Left", "_R": "Right", "_l": "Left", "_r": "Right", ".L": "Left", ".R": "Right"}


def sources_of(names: tuple[str, ...]) -> dict[str, list[int]]:
    """For each of ARKit's 52 that the mesh has: indices of the mesh's shapes that add up to it."""
    index = {name: i for i, name in enumerate(names)}
    own = {_plain(name): i for name, i in index.items()}
    out: dict[str, list[int]] = {}
    for shape in SHAPES:
        if shape in own:
            out[shape] = [own[shape]]
        elif shape in MERGED and all(part in index for part in MERGED[shape]):
            out[shape] = [index[part] for part in MERGED[shape]]
    return out


def _plain(name: str) -> str:
    for suffix, side in SIDES.items():
        if name.endswith(suffix):
            return name[: -len(suffix)] + side
    return name
