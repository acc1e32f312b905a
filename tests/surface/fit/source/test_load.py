"""Loading: suffixes, options, size limits, non-manifold meshes, damaged NPZ files."""

from dataclasses import replace

import numpy as np
import pytest
from slit_sheet import slit_sheet, write_npz

from surface.base.errors import FitError
from surface.fit.source.load import LoadOptions, keep_faces, load_mesh, wanted_faces
from surface.fit.source.mesh import check_manifold
from surface.readers import meshdata


@pytest.mark.parametrize("kind", [".ply", ".stl", ".off"])
def test_of_a_mesh_that_can_have_no_shapes_it_is_told_where_to_take_them_from(tmp_path, kind):
    with pytest.raises(FitError, match=rf"a \{kind} file has no shapes") as told:
        load_mesh(tmp_path / f"m{kind}")
    assert "--expressions-from ict" in told.value.hint


def test_an_unknown_suffix_and_misplaced_shapes(tmp_path):
    with pytest.raises(FitError, match=r"\.fbx is no mesh"):
        load_mesh(tmp_path / "m.fbx")
    path = write_npz(tmp_path / "m.npz", slit_sheet())
    with pytest.raises(FitError, match=r"belongs to an \.obj mesh"):
        load_mesh(path, LoadOptions(shapes=tmp_path))


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("in", 25.4)])
def test_a_told_unit_is_taken(tmp_path, unit, factor):
    got = load_mesh(write_npz(tmp_path / "m.npz", slit_sheet()), LoadOptions(unit=unit))
    np.testing.assert_allclose(got.mesh.vertices, factor * slit_sheet().vertices)
    np.testing.assert_allclose(got.mesh.deltas, factor * slit_sheet().deltas)
    assert got.notes == ()


def test_a_guessed_unit_is_said(tmp_path):
    assert load_mesh(write_npz(tmp_path / "m.npz", slit_sheet())).notes == (
        "unit taken to be mm: all of it is 200 mm high (say --unit otherwise)",
    )


def test_meshes_beyond_memory_are_refused(tmp_path, monkeypatch):
    path = write_npz(tmp_path / "m.npz", slit_sheet())
    monkeypatch.setattr(meshdata, "MAX_VERTICES", 600)
    with pytest.raises(FitError, match="625 vertices; 600 are the most"):
        load_mesh(path)
    monkeypatch.setattr(meshdata, "MAX_VERTICES", 1000)
    monkeypatch.setattr(meshdata, "MAX_MOVES", 1000)
    with pytest.raises(FitError, match="2 shapes of 625 vertices are too many"):
        load_mesh(path)


def test_three_faces_at_an_edge_are_named():
    mesh = slit_sheet()
    fin = np.array([[mesh.faces[0, 0], mesh.faces[0, 1], 600, -1]])
    bad = replace(mesh, faces=np.vstack([mesh.faces, fin]), face_uv=np.vstack([mesh.face_uv, fin]))
    check_manifold(mesh, "m")
    bad = replace(bad, faces=np.vstack([bad.faces, fin[:, [1, 0, 2, 3]]]), face_uv=np.vstack([bad.face_uv, fin]))
    with pytest.raises(FitError, match="m: not a manifold: the edge between vertices 0 and 25 belongs to 3 faces"):
        check_manifold(bad, "m")


def test_neighbours_that_run_opposite_ways_are_named():
    mesh = slit_sheet()
    faces = mesh.faces.copy()
    faces[40] = faces[40, ::-1]
    with pytest.raises(FitError, match="is run through twice in one direction") as e:
        check_manifold(replace(mesh, faces=faces, piece=np.zeros(len(faces), int), pieces=("cheek",)), "m")
    assert "'cheek'" in str(e.value)


def test_faces_are_kept_with_the_vertices_they_use():
    mesh = slit_sheet()
    kept = keep_faces(mesh, np.arange(len(mesh.faces)) < 3)
    assert len(kept.vertices) == 8 and kept.deltas.shape == (2, 8, 3)
    np.testing.assert_array_equal(kept.vertices[kept.faces], mesh.vertices[mesh.faces[:3]])


@pytest.mark.parametrize(
    "other",
    [
        {"neutral": np.array(["a"] * 625)}, {"names": np.array([["a"], ["b"]])}, {"faces": np.zeros((4, 4))},
        {"deltas": np.zeros(3)}, {"uv": np.float64(1.0)}, {"neutral": np.zeros((0, 3))},
    ],
)  # fmt: skip
def test_arrays_of_another_kind_are_refused(tmp_path, other):
    with pytest.raises(FitError, match=r"m\.npz: "):
        load_mesh(write_npz(tmp_path / "m.npz", slit_sheet(), **other))


def test_objects_are_never_unpickled(tmp_path):
    path = write_npz(tmp_path / "m.npz", slit_sheet(), names=np.array([{}, {}], object))
    with pytest.raises(FitError, match="holds Python objects"):
        load_mesh(path)


def test_flipped_bits_give_one_kind_of_error(tmp_path):
    whole = write_npz(tmp_path / "m.npz", slit_sheet()).read_bytes()
    rng, path, errors = np.random.default_rng(5), tmp_path / "n.npz", 0
    for k in range(120):
        bad = bytearray(whole)
        at = rng.integers(0, 400, 2) if k % 2 else rng.integers(0, len(bad), 2)
        for i in at:
            bad[i] ^= 1 << int(rng.integers(8))
        path.write_bytes(bad[: int(rng.integers(len(bad)))] if k % 5 == 0 else bad)
        try:
            load_mesh(path)
        except FitError:
            errors += 1
    assert errors > 60


def test_leaving_out_parts_of_a_mesh_without_names_says_that_it_has_none():
    mesh = replace(slit_sheet(), pieces=())
    with pytest.raises(FitError, match=r"--without Hair: face\.obj has no named objects or materials") as caught:
        wanted_faces(mesh, ("Hair",), "face.obj")
    assert "leave the option out" in caught.value.hint
    assert wanted_faces(mesh, (), "face.obj").all()
