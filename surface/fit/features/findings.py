"""Say in plain lines what was found in a mesh, and what was not, with what to do."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from surface.fit.source.placing.anatomy import Landmarks
from surface.fit.source.placing.orient import axis_names
from surface.head.model.data import HeadData
from surface.head.model.placement import Placement

INSIDE = {"teeth": "teeth", "tongue": "tongue", "brow": "brows or hair", "lash": "lashes"}  # materials, in words
KINDS = {"teeth": ("teeth",), "tongue": ("tongue",), "brow": ("brow", "hair", "beard"), "lash": ("lash",)}
"""The kinds of pieces that become parts of each of these materials."""
CLOSING = ("eyeBlinkLeft", "eyeBlinkRight")
NO_PLACE = (
    "the head's place is not known, because its eyes were not found; it stays where it is in the file, and cameras "
    "look at its outline (shapes named eyeBlinkLeft and eyeBlinkRight, or two eyeballs, would show the eyes)"
)
NO_EYES = (
    "no eyes: no two balls in the mesh are eyes, so the head has none and its lids close over nothing (export the "
    "eyeballs with the face, each as a piece of its own)"
)
NO_LIDS = (
    "the lids do not move: the mesh has no shape {}, so these eyes never blink. Type the command again with "
    "--expressions-from ict: the head keeps the mesh's own shapes, and gets those that it lacks from the shipped head "
    "(or give the mesh shapes of that name, or say theirs by --names)"
)


def findings(
    head: HeadData, marks: Landmarks, kinds: Collection[str] = (), worn: Collection[str] = ()
) -> list[str]:  # fmt: skip
    """Lines on the unit, the axes and the place of a fitted head, and on the features it has and has not.

    kinds : of the pieces that the mesh has, those that were left out, too. worn : of those that are kept as they are.
    """
    lines = [] if head.placement is None else [_placed(head.placement)]
    words = INSIDE | ({"brow": "brows"} if "hair" in worn else {})
    there, absent = _features(head, words)
    lines += [f"found: {', '.join(there)}"] if there else []
    lines += [NO_PLACE] if marks.eyes is None and head.eye_radius <= 0 else []
    lines += [NO_EYES] if head.eye_radius <= 0 else []
    open_eyes = [name for name in CLOSING if name not in _groups(head)]
    lines += [NO_LIDS.format(" or ".join(open_eyes))] if open_eyes else []
    left_out = [words[material] for material in absent if not set(KINDS[material]).isdisjoint(kinds)]
    absent_words = [word for word in map(words.__getitem__, absent) if word not in left_out]
    lines += [f"in the mesh, but left out and not drawn: {', '.join(left_out)}"] if left_out else []
    lines += [f"not in the mesh, and not drawn: {', '.join(absent_words)}"] if absent_words else []
    return lines


def _placed(placement: Placement) -> str:
    """Unit, axes and shift in words."""
    unit = placement.unit or f"{placement.scale:.4g} mm"
    square = bool(np.isclose(np.abs(placement.turn).max(axis=1), 1.0).all())
    up, forward = axis_names(placement.turn)
    axes = f"up is {up}, forward is {forward}" if square else "it stands askew"
    x, y, z = (f"{value:.0f}" for value in np.round(placement.shift) + 0.0)
    moved = f"moved by {x}, {y}, {z} mm" if np.abs(placement.shift).max() > 0.5 else "it stands where it belongs"
    return f"placed: the file's unit is {unit}, {axes}; {moved}"


def _features(head: HeadData, words: Mapping[str, str]) -> tuple[list[str], list[str]]:
    """What the head has, in words, and the materials of usual parts that it has not; ``words`` of these materials."""
    materials = {p.material for p in head.parts}
    there = []
    if head.eye_radius > 0:
        apart = float(np.linalg.norm(head.eyes[0] - head.eyes[1]))
        there.append(f"eyes {apart:.0f} mm apart, of {2.0 * head.eye_radius:.0f} mm")
    if all(name in _groups(head) for name in CLOSING):
        there.append("lids that close")
    if "jawOpen" in _groups(head):
        there.append("a jaw that opens")
    there += [word for material, word in words.items() if material in materials]
    return there, [material for material in words if material not in materials]


def _groups(head: HeadData) -> set[str]:
    return {g.name for p in head.parts for g in p.groups}
