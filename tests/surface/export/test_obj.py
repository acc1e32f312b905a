"""surface.export.obj: trimesh and a few lines of parsing read what was written."""

import os

import numpy as np
import pytest
from small_head import small_head

from surface.base.errors import ExportError
from surface.export import export_head
from surface.export.shapes import export_parts
from surface.head import Head


def lines(path, word: str) -> list[list[str]]:
    return [row.split()[1:] for row in path.read_text().splitlines() if row.split()[:1] == [word]]


def numbers(path, word: str) -> np.ndarray:
    return np.array(lines(path, word), float)


@pytest.fixture
def head() -> Head:
    return Head(small_head())


def test_all_parts_come_one_after_the_other_counted_from_one(tmp_path, head):
    export_head(head, tmp_path / "h.obj")
    parts, path = export_parts(head), tmp_path / "h.obj"
    for word, key, atol in (("v", "vertices", 6e-6), ("vn", "normals", 6e-6), ("vt", "uv", 6e-7)):
        wanted = np.concatenate([getattr(p, key) for p in parts])
        np.testing.assert_allclose(numbers(path, word), wanted, atol=atol, rtol=1e-7)
    starts = np.cumsum([1, *(len(p.vertices) for p in parts)])
    wanted = np.concatenate([p.triangles + start for p, start in zip(parts, starts, strict=False)])
    assert lines(path, "f") == [[f"{i}/{i}/{i}" for i in row] for row in wanted]
    assert lines(path, "o") == [["a"], ["b"], ["tooth"]] and lines(path, "usemtl") == [["skin"]] * 3
    first = path.read_text().splitlines()[:2]
    assert first == ["# small, written by omote; millimetres, y up, z forward", "mtllib h.mtl"]


def test_every_shape_is_a_file_with_the_same_faces(tmp_path, head):
    written = export_head(head, tmp_path / "h.obj")
    assert written == [tmp_path / "h.obj", tmp_path / "h.mtl", tmp_path / "h_shapes"]
    files = sorted((tmp_path / "h_shapes").iterdir())
    assert [f.name for f in files] == ["jawForward.obj", "jawOpen.obj", "mouthPucker.obj"]
    rest = numbers(tmp_path / "h.obj", "v")
    for file in files:
        moved = np.concatenate([p.displacements.get(file.stem, np.zeros_like(p.vertices)) for p in export_parts(head)])
        assert np.abs(moved).max() > 1
        np.testing.assert_allclose(numbers(file, "v"), rest + moved, atol=2e-5)
        for word in ("f", "vt", "o", "usemtl"):
            assert lines(file, word) == lines(tmp_path / "h.obj", word)
        assert not lines(file, "vn") and not lines(file, "mtllib")


def test_old_shapes_are_replaced_and_other_files_stay(tmp_path, head):
    (tmp_path / "other.txt").write_text("stays")
    export_head(head, tmp_path / "h.obj")
    shapes = tmp_path / "h_shapes"
    (shapes / "jawOpen.obj").rename(shapes / "older.obj")  # a shape that the head had when it was exported before
    (shapes / "mine.obj").write_text("# sculpted by hand\n")
    (shapes / "notes.txt").write_text("what is left to do")
    (shapes / "mine").mkdir()
    export_head(head, tmp_path / "h.obj")
    wanted = ["jawForward.obj", "jawOpen.obj", "mine", "mine.obj", "mouthPucker.obj", "notes.txt"]
    assert sorted(p.name for p in shapes.iterdir()) == wanted
    assert (shapes / "mine.obj").read_text() == "# sculpted by hand\n"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["h.mtl", "h.obj", "h_shapes", "other.txt"]


def test_a_pose_is_written_without_shapes_and_leaves_older_ones(tmp_path, head):
    export_head(head, tmp_path / "h.obj")
    written = export_head(head, tmp_path / "h.obj", {"jawOpen": 1.0})
    assert written == [tmp_path / "h.obj", tmp_path / "h.mtl"]
    assert (tmp_path / "h_shapes" / "jawOpen.obj").exists()
    np.testing.assert_allclose(
        numbers(tmp_path / "h.obj", "v"), numbers(tmp_path / "h_shapes" / "jawOpen.obj", "v"), atol=3e-3
    )


def test_trimesh_reads_the_same_triangles(tmp_path, head):
    trimesh = pytest.importorskip("trimesh", reason="needs trimesh (development only)")
    export_head(head, tmp_path / "h.obj")
    scene = trimesh.load(tmp_path / "h.obj", process=False, split_object=True, group_material=False)
    meshes = list(scene.geometry.values()) if hasattr(scene, "geometry") else [scene]
    area = sum(mesh.area for mesh in meshes)
    wanted = sum(trimesh.Trimesh(p.vertices, p.triangles, process=False).area for p in head.parts)
    assert sum(len(mesh.faces) for mesh in meshes) == sum(len(p.triangles) for p in head.parts)
    assert area == pytest.approx(wanted, rel=1e-5)
    rest = np.concatenate([p.vertices for p in head.parts])
    np.testing.assert_allclose(scene.bounds, [rest.min(axis=0), rest.max(axis=0)], atol=1e-4)


@pytest.mark.skipif(os.name != "posix", reason="links and permissions of POSIX")
def test_links_stay_links_and_files_keep_their_permissions(tmp_path, head):
    kept = tmp_path / "kept"
    kept.mkdir()
    for name in ("h.obj", "h.mtl"):
        (kept / name).write_text("old")
        (kept / name).chmod(0o640)
        (tmp_path / name).symlink_to(kept / name)
    export_head(head, tmp_path / "h.obj")
    for name in ("h.obj", "h.mtl"):
        assert (tmp_path / name).is_symlink() and (kept / name).read_text() != "old"
        assert (kept / name).stat().st_mode & 0o777 == 0o640
    assert sorted(p.name for p in kept.iterdir()) == ["h.mtl", "h.obj"]


def test_where_shapes_cannot_be_written_the_old_files_stay(tmp_path, head):
    (tmp_path / "h.obj").write_text("old")
    (tmp_path / "h_shapes").write_text("a file in the way")
    with pytest.raises(ExportError, match="cannot be written"):
        export_head(head, tmp_path / "h.obj")
    assert (tmp_path / "h.obj").read_text() == "old" and not (tmp_path / "h.mtl").exists()
