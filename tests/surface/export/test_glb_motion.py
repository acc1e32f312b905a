"""Animated heads: the file, played by the letter of the specification, shows what the head shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from small_head import small_head

from surface.base.errors import ExportError
from surface.export import Animation, export_head
from surface.head import Head
from surface.head.model.parameters import NAMES, SHAPES
from tests.surface.export.test_glb_document import Decoded

TIMES = np.array([0.0, 0.1, 0.25, 0.5])


def motion(**values: list[float]) -> Animation:
    rows = np.zeros((len(TIMES), len(NAMES)))
    for name, column in values.items():
        rows[:, NAMES.index(name)] = column
    return Animation("speech", TIMES, rows)


class Played(Decoded):
    """Plays the first animation: samplers, weights, nodes and skins as in sections 3.7.3, 3.8 and 3.11."""

    def accessor(self, index: int) -> np.ndarray:
        a = self.document["accessors"][index]
        if a["type"] in ("VEC4", "MAT4"):
            dtype, width = ("<f4" if a["componentType"] == 5126 else "u1"), {"VEC4": 4, "MAT4": 16}[a["type"]]
            return self.view(a["bufferView"], dtype).reshape(-1, width)
        return super().accessor(index)

    def channels(self, path: str) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        (animation,) = self.document["animations"]
        found = {}
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            assert sampler["interpolation"] == "LINEAR"
            times = self.accessor(sampler["input"])[:, 0]
            assert {"min", "max"} <= set(self.document["accessors"][sampler["input"]])
            if channel["target"]["path"] == path:
                found[channel["target"]["node"]] = times, self.accessor(sampler["output"]).reshape(len(times), -1)
        return found

    def vertices(self, frame: int) -> dict[str, np.ndarray]:
        """World positions of every part (mm) at a key."""
        weights, turns = self.channels("weights"), self.channels("rotation")
        nodes, out = self.document["nodes"], {}
        parents = {child: k for k, node in enumerate(nodes) for child in node.get("children", [])}

        def world(k: int) -> np.ndarray:
            own = np.eye(4)
            own[:3, 3] = nodes[k].get("translation", (0, 0, 0))
            if k in turns:
                own[:3, :3] = matrix(turns[k][1][frame])
            return world(parents[k]) @ own if k in parents else own

        for k, node in enumerate(nodes):
            if "mesh" not in node:
                continue
            mesh = self.document["meshes"][node["mesh"]]
            (primitive,) = mesh["primitives"]
            points = self.accessor(primitive["attributes"]["POSITION"]).astype(float)
            shares = weights[k][1][frame] if k in weights else []
            for target, weight in zip(primitive.get("targets", []), shares, strict=False):
                points = points + weight * self.accessor(target["POSITION"])
            homogeneous = np.column_stack([points, np.ones(len(points))])
            if "skin" in node:
                skin = self.document["skins"][node["skin"]]
                inverse = self.accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
                joints = np.array([world(j) @ inverse[i] for i, j in enumerate(skin["joints"])])
                ids = self.accessor(primitive["attributes"]["JOINTS_0"])
                share = self.accessor(primitive["attributes"]["WEIGHTS_0"])
                np.testing.assert_allclose(share.sum(axis=1), 1.0, atol=1e-6)
                assert not ids[share == 0.0].any()
                placed = np.einsum("vj,vjab,vb->va", share, joints[ids], homogeneous)
            else:
                placed = homogeneous @ world(k).T
            out[node["name"]] = 1000.0 * placed[:, :3]
        return out


def matrix(q: np.ndarray) -> np.ndarray:
    """Rotation of a quaternion x, y, z, w, from Hamilton's product."""
    x, y, z, w = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def exported(tmp_path: Path, head: Head, animation: Animation) -> Played:
    (path,) = export_head(head, tmp_path / "h.glb", animation=animation)
    return Played(path)


def test_weights_over_time_are_the_values_of_the_take(tmp_path: Path) -> None:
    head = Head(small_head())
    file = exported(tmp_path, head, motion(jawOpen=[0, 0.5, 1, 0.25], mouthClose=[0.3, 0.2, 0.4, 0.9]))
    moved = 0
    for node, (times, weights) in file.channels("weights").items():
        names = file.document["meshes"][file.document["nodes"][node]["mesh"]]["extras"]["targetNames"]
        np.testing.assert_allclose(times, TIMES, atol=1e-7)
        assert weights.shape == (4, len(names))
        for name, column in zip(names, weights.T, strict=True):
            expected = {"jawOpen": [0, 0.5, 1, 0.25], "mouthClose": [0, 0.2, 0.4, 0.25]}.get(name, [0] * 4)
            np.testing.assert_allclose(column, expected, atol=1e-6)
            moved += name == "jawOpen"
    assert moved and "skins" not in file.document and file.document["animations"][0]["name"] == "speech"


def test_every_key_shows_the_head_in_that_pose(tmp_path: Path) -> None:
    head = Head(small_head())
    names = [name for name in head.groups if not name.startswith(("eyeLook", "eyeBlink", "mouthClose", "tongue"))][:2]
    animation = motion(**{name: [0, 0.3, 0.7, 1] for name in names[:1]}, headYaw=[0, 0.2, -0.5, 1],
                       headPitch=[0, 0.1, 0, -0.3], headRoll=[0, 0, 0.2, 0.1])  # fmt: skip
    file = exported(tmp_path, head, animation)
    for frame, row in enumerate(animation.values):
        head.pose(head.values(dict(zip(NAMES, row, strict=True))))
        shown = file.vertices(frame)
        for part in head.parts:
            share = head.data.neck.share(part.vertices.astype(float))
            rigid = (share == 0.0) | (share == 1.0)  # the neck bends by angles here, by a mix of positions there
            apart = np.abs(shown[part.name] - part.vertices)[rigid]
            assert apart.size == 0 or apart.max() < 0.6, (frame, part.name)


def test_angles_of_the_eyes_become_their_shapes() -> None:
    weights = motion(
        leftEyeYaw=[0, 0.5, -0.5, 0], rightEyePitch=[0, 1, -1, 0], eyeLookOutLeft=[0, 0.25, 0, 0]
    ).weights()
    column = {name: weights[:, SHAPES.index(name)].tolist() for name in SHAPES if weights[:, SHAPES.index(name)].any()}
    assert column.pop("eyeLookDownRight") == [0, 1, 0, 0] and column.pop("eyeLookUpRight") == [0, 0, 1, 0]
    assert column == {"eyeLookOutLeft": [0, 0.75, 0, 0], "eyeLookInLeft": [0, 0, 0.5, 0]}


def test_quaternions_do_not_jump() -> None:
    turning = np.zeros((200, len(NAMES)))
    turning[:, NAMES.index("headYaw")] = np.sin(np.arange(200) / 9.0)
    turning[:, NAMES.index("headRoll")] = np.cos(np.arange(200) / 7.0)
    found = Animation("x", np.arange(200) / 60, turning).head_quaternions()
    assert found is not None and np.linalg.norm(np.diff(found, axis=0), axis=1).max() < 0.2
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)


def test_a_still_take_has_no_animation_and_trimesh_reads_both(tmp_path: Path) -> None:
    head = Head(small_head())
    still = exported(tmp_path, head, motion())
    assert "animations" not in still.document
    exported(tmp_path, head, motion(jawOpen=[0, 1, 0, 1], headYaw=[0, 1, 0, 1]))
    scene = trimesh.load(tmp_path / "h.glb")
    assert len(scene.geometry) == len(head.parts)


@pytest.mark.parametrize(
    ("times", "rows", "why"),
    [
        ([0.0, 0.0], 2, "times that rise"),
        ([-1.0, 0.0], 2, "times that rise"),
        ([], 0, "times that rise"),
        ([0.0], 2, "times that rise"),
    ],
)
def test_animations_that_cannot_be_are_refused(times: list[float], rows: int, why: str) -> None:
    with pytest.raises(ExportError, match=why):
        Animation("x", np.array(times), np.zeros((rows, len(NAMES))))
    with pytest.raises(ExportError, match="no numbers"):
        Animation("x", np.zeros(1), np.full((1, len(NAMES)), np.nan))


def test_formats_and_frames_without_animation_say_so(tmp_path: Path) -> None:
    head = Head(small_head())
    with pytest.raises(ExportError, match="'obj' holds no animation"):
        export_head(head, tmp_path / "h.obj", animation=motion())
    with pytest.raises(ExportError, match="--frame file: no animation"):
        export_head(head, tmp_path / "h.glb", frame="file", animation=motion())
