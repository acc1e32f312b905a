"""Exports in head space and in the frame of the head's source."""

from dataclasses import replace

import numpy as np
import pytest
from small_head import small_head

from surface.base.errors import ExportError
from surface.export import Exporter, export_head
from surface.export.shapes import _manifold
from surface.head import Head
from surface.head.model.placement import Placement
from surface.readers.gltf.mesh import read_gltf
from surface.readers.obj import read_obj

TURN = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])
PLACED = Placement(TURN, 10.0, np.array([1.0, -2.0, 3.5]), "cm")


@pytest.fixture
def head() -> Head:
    return Head(replace(small_head(), placement=PLACED))


@pytest.mark.parametrize(("suffix", "read", "per_mm"), [(".glb", read_gltf, 0.001), (".obj", read_obj, 1.0)])
def test_the_files_own_frame_comes_back(tmp_path, head, suffix, read, per_mm):
    export_head(head, tmp_path / f"head{suffix}")
    export_head(head, tmp_path / f"file{suffix}", frame="file")
    usual, own = read(tmp_path / f"head{suffix}"), read(tmp_path / f"file{suffix}")
    there, back = usual.vertices / per_mm, PLACED.points(own.vertices)
    np.testing.assert_allclose(np.sort(there, axis=0), np.sort(back, axis=0), atol=2e-3)
    np.testing.assert_allclose(
        np.sort(usual.deltas / per_mm, axis=1), np.sort(PLACED.moves(own.deltas), axis=1), atol=2e-3
    )
    assert own.names == usual.names and np.abs(usual.deltas).max() > 0


def test_an_eyeball_turns_about_its_own_centre_there_too(tmp_path):
    data = small_head()
    ball = replace(data.parts[2], name="ball", follows="left_eye", material="eye")
    head = Head(replace(data, parts=[*data.parts[:2], ball], placement=PLACED))
    export_head(head, tmp_path / "file.glb", frame="file")
    own = read_gltf(tmp_path / "file.glb")
    rest = head.part("ball").vertices
    np.testing.assert_allclose(PLACED.points(own.vertices).max(axis=0)[0], rest.max(axis=0)[0], atol=1e-3)


def test_what_cannot_be_written_is_said(tmp_path, head):
    with pytest.raises(ExportError, match="does not say how its mesh was placed") as e:
        export_head(Head(small_head()), tmp_path / "h.glb", frame="file")
    assert "fit it again" in e.value.hint
    with pytest.raises(ExportError, match="frame 'world'"):
        export_head(head, tmp_path / "h.glb", frame="world")
    plain = Exporter(api=1, kind="dot", title="", suffixes=(".dot",), write=lambda *_: [])
    with pytest.raises(ExportError, match="in head space only"):
        export_head(head, tmp_path / "h.dot", extra=[plain], frame="file")
    assert not list(tmp_path.iterdir())


def test_exported_triangles_are_a_manifold():
    points = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [10.1, 0.1, 0], [10, 10, 0]], np.float32)
    sheet = np.array([[0, 1, 2], [1, 4, 2]], np.int32)
    np.testing.assert_array_equal(_manifold(points, sheet), sheet)
    sliver = np.array([[1, 2, 3]], np.int32)  # runs along the edge 1-2 once more
    np.testing.assert_array_equal(_manifold(points, np.concatenate([sheet, sliver])), sheet)
