"""Adds motion to a head in binary glTF 2.0 (specification, sections 3.7.3, 3.11 and 5): an animation of the weights of
morph targets, and a skin with two joints, so that the neck bends where the head turns.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from surface.base.arrays import Floats
from surface.export.animation import Animation
from surface.export.glb_document import Document
from surface.export.shapes import ExportPart
from surface.head import Head

_FLOAT, _BYTE, _ARRAY = 5126, 5121, 34962
_METRES = 0.001


def add_motion(document: Document, head: Head, parts: list[ExportPart], animation: Animation) -> None:
    """Add an animation of the parts, whose meshes and nodes 1.. the document has in the same order."""
    motion = _Motion(document, animation)
    names = list(dict.fromkeys(name for part in parts for name in part.displacements))
    weights = animation.weights_of(names) if names else np.zeros((len(animation.times_s), 0))
    for k, part in enumerate(parts):
        shown = weights[:, [names.index(name) for name in part.displacements]]
        if shown.any():
            motion.channel(1 + k, "weights", shown.reshape(-1, 1), tuple(part.displacements))
    turned = animation.head_quaternions()
    if turned is not None:
        motion.channel(_add_joints(document, head, parts), "rotation", turned)
    motion.close()


class _Motion:
    """An animation while it is written; samplers with the same values are written once."""

    def __init__(self, document: Document, animation: Animation) -> None:
        self._document, self._name = document, animation.name
        self._times = _numbers(document, animation.times_s[:, None], bounds=True)
        self._samplers: list[dict[str, Any]] = []
        self._channels: list[dict[str, Any]] = []
        self._known: dict[tuple[str, ...], int] = {}

    def channel(self, node: int, path: str, values: Floats, key: tuple[str, ...] = ()) -> None:
        """Move a node's ``path``; channels with the same ``key`` have the same values."""
        if key not in self._known or not key:
            output = _numbers(self._document, values)
            self._known[key] = len(self._samplers)
            self._samplers.append({"input": self._times, "output": output, "interpolation": "LINEAR"})
        self._channels.append({"sampler": self._known[key], "target": {"node": node, "path": path}})

    def close(self) -> None:
        """Add it to the document; nothing where nothing moves, because an animation must have a channel."""
        if self._channels:
            animation = {"name": self._name, "channels": self._channels, "samplers": self._samplers}
            self._document.content["animations"] = [animation]


def _numbers(document: Document, rows: Floats, *, bounds: bool = False) -> int:
    """Return an accessor of scalars or quaternions, which are no vertices."""
    values = np.ascontiguousarray(rows, np.float32)
    kind = {1: "SCALAR", 4: "VEC4"}[values.shape[1]]
    return document.accessor(values, _FLOAT, kind, bounds=bounds, bufferView=document.view(values))


def _add_joints(document: Document, head: Head, parts: list[ExportPart]) -> int:
    """Bind the parts to a joint that stays and one that turns about the neck; returns the node of the latter.

    Eyeballs, which have nodes about their own centres, become children of the joint.
    """
    nodes: list[dict[str, Any]] = document.content["nodes"]
    pivot = _METRES * np.array(head.data.neck.pivot)
    still, turning = len(nodes), len(nodes) + 1
    nodes += [{"name": "body"}, {"name": "head", "translation": pivot.tolist(), "children": list[int]()}]
    rigid = [1 + k for k, part in enumerate(parts) if part.pivot.any()]
    for k in rigid:
        nodes[k]["translation"] = (np.array(nodes[k]["translation"]) - pivot).tolist()
    nodes[turning]["children"] = rigid
    nodes[0]["children"] = [k for k in nodes[0]["children"] if k not in rigid] + [still, turning]
    for k, part in enumerate(parts, 1):
        if k not in rigid:
            nodes[k]["skin"] = 0
            share = head.data.neck.share(part.vertices.astype(float))
            _bind(document, document.content["meshes"][nodes[k]["mesh"]], share)
    document.content["skins"] = [_skin(document, still, turning, pivot)]
    return turning


def _bind(document: Document, mesh: dict[str, Any], share: Floats) -> None:
    """Give each vertex of a mesh its share (m,) of the turning joint, the rest of it the one that stays."""
    joints, weights = np.zeros((len(share), 4), np.uint8), np.zeros((len(share), 4), np.float32)
    weights[:, 0], weights[:, 1] = share, 1.0 - share.astype(np.float32)
    joints[:, 0] = share > 0.0  # an unused joint must be 0
    weights[share <= 0.0, :2] = 1.0, 0.0
    attributes = mesh["primitives"][0]["attributes"]
    attributes["JOINTS_0"] = document.accessor(joints, _BYTE, "VEC4", bufferView=document.view(joints, _ARRAY))
    attributes["WEIGHTS_0"] = document.accessor(weights, _FLOAT, "VEC4", bufferView=document.view(weights, _ARRAY))


def _skin(document: Document, still: int, turning: int, pivot: Floats) -> dict[str, Any]:
    inverse: NDArray[np.float32] = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    inverse[1, 3, :3] = -pivot  # column-major: the translation is the last row
    flat = inverse.reshape(2, 16)
    bind = document.accessor(flat, _FLOAT, "MAT4", bufferView=document.view(flat))
    return {"joints": [still, turning], "inverseBindMatrices": bind}
