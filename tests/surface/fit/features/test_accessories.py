"""surface.fit.features.accessories: what a head keeps as it is, from a mesh's pieces to meshes in head space."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cards import RED, picture
from PIL import Image
from slit_sheet import slit_sheet

from surface.base.errors import FitError
from surface.fit import fit_head
from surface.fit.features import accessories
from surface.fit.features.accessories import DARKEST, corner_normals, keep_accessories, make_accessories
from surface.fit.source.kinds import kinds, worn_faces
from surface.fit.source.load import LoadOptions, load_mesh, worn_mesh
from surface.fit.source.mesh import FitMesh
from surface.fit.source.placing.place import HeadSize
from surface.head import Head
from surface.head.model.accessories import fault_of
from surface.head.model.placement import Placement
from surface.readers.meshdata import Material, linear

EYES = np.array([0.0, 36.0, 84.0])


def strips(middles: list[tuple[float, float, float]], names: tuple[str, ...], material: Material) -> FitMesh:
    """Quads of 20 mm that look ahead, one of each name, over the whole of a texture."""
    square = np.array([[-10.0, -10, 0], [10, -10, 0], [10, 10, 0], [-10, 10, 0]])
    k, rows = len(names), np.arange(4 * len(names)).reshape(-1, 4)
    uv = np.tile(np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), (k, 1))
    return FitMesh(
        np.concatenate([square + m for m in middles]), rows, uv, rows, (), np.zeros((0, 4 * k, 3)), np.arange(k), names,
        (material,) * k,
    )  # fmt: skip


def dressed_file(folder: Path, moves: float = 0.0) -> Path:
    """A sheet as a face in an OBJ, with hair, a hat and boots beside it; a shape moves the hair by so many mm."""
    sheet = slit_sheet()
    worn = strips([(0, 130, 10), (30, 130, 10), (0, -90, 0)], ("Hair", "Hat", "Boots"), Material())
    (folder / "m_shapes").mkdir(parents=True)
    Image.open(io.BytesIO(picture(RED[:3], (2048, 512)))).save(folder / "red.png")
    (folder / "m.mtl").write_text("newmtl Red\nKd 1 1 1\nmap_Kd red.png\n")
    first = len(sheet.vertices)
    lines = ["mtllib m.mtl", "o Face"]
    faces = [f"f {' '.join(f'{a + 1}/{b + 1}' for a, b in zip(*rows, strict=True) if a >= 0)}"
             for rows in zip(sheet.faces.tolist(), sheet.face_uv.tolist(), strict=True)]  # fmt: skip
    for k, name in enumerate(worn.pieces):
        faces += [f"o {name}", "usemtl Red"]
        faces += [f"f {' '.join(f'{a + first + 1}/{a + len(sheet.uv) + 1}' for a in worn.faces[k].tolist())}"]
    for path, delta in ((folder / "m.obj", 0.0), (folder / "m_shapes" / "jawOpen.obj", 1.0)):
        own = worn.vertices + delta * moves * np.array([[1.0, 0, 0]]) * (np.arange(12) < 4)[:, None]
        points = np.vstack([sheet.vertices + delta * sheet.deltas[0], own])
        text = lines + [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points.tolist()]
        text += [f"vt {u:.6f} {v:.6f}" for u, v in np.vstack([sheet.uv, worn.uv]).tolist()]
        path.write_text("\n".join(text + faces) + "\n")
    return folder / "m.obj"


def test_hair_and_hat_are_kept_in_place_with_a_smaller_texture_and_boots_are_not(tmp_path):
    loaded = load_mesh(dressed_file(tmp_path), LoadOptions(unit="mm"))
    kept = make_accessories(loaded)
    assert [(one.name, one.kind) for one in kept.accessories] == [("Hair/Red", "hair"), ("Hat/Red", "hat")]
    assert kept.notes == ["kept as they are, with their texture: hair 'Hair/Red'; hat 'Hat/Red'"]
    assert kept.pieces == {"Hair/Red": "hair, kept as it is", "Hat/Red": "hat, kept as it is"}
    assert any(note == "boots left out: 'Boots/Red'" for note in loaded.notes)
    hat = kept.accessories[1]
    np.testing.assert_allclose(sorted(hat.vertices[:, 0]), [20, 20, 40, 40], atol=1e-4)
    with Image.open(io.BytesIO(hat.texture)) as image:
        assert image.size == (1024, 256) and np.abs(np.subtract(image.getpixel((9, 9)), RED[:3])).max() < 12
    corner = hat.uv[hat.vertices.sum(axis=1).argmin()]
    np.testing.assert_allclose(corner, [0.0, 1.0], atol=1e-6)  # the lower left of the picture, whose v points down


def test_without_leaves_it_out_and_hair_that_shapes_move_is_fitted(tmp_path):
    path = dressed_file(tmp_path)
    loaded = load_mesh(path, LoadOptions(unit="mm", without=("Hair",)))
    assert [one.kind for one in make_accessories(loaded).accessories] == ["hat"]
    moving = load_mesh(dressed_file(tmp_path / "b", moves=9.0), LoadOptions(unit="mm"))
    assert [one.kind for one in make_accessories(moving).accessories] == ["hat"]
    assert len(moving.mesh.faces) == len(loaded.mesh.faces) + 1


@pytest.mark.slow
def test_a_fit_writes_them_and_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr("surface.fit.features.generic.FINEST", 2.0)  # few points: their place does not matter here
    monkeypatch.setattr("surface.fit.features.generic.POINTS", 300)
    report = fit_head(
        dressed_file(tmp_path), tmp_path / "head", name="me", options=LoadOptions(unit="mm"), force=True
    )  # fmt: skip
    assert report.pieces["Hair/Red"] == "hair, kept as it is" and report.pieces["Boots/Red"] == "boots, left out"
    assert any(note.startswith("kept as they are") for note in report.notes)
    assert [worn.accessory.kind for worn in Head.load(tmp_path / "head").accessories] == ["hair", "hat"]


def test_what_is_worn_far_from_the_head_is_left_out_but_hair_never_is():
    worn = strips([(0, 30, 100), (300, -500, 0), (0, -400, 0)], ("Glasses", "Accessory", "Hair"), Material())
    kept = keep_accessories(worn, Placement(), EYES, HeadSize())
    assert [one.kind for one in kept.accessories] == ["glasses", "hair"]
    assert kept.pieces["Accessory"] == "jewellery, left out"
    assert kept.notes[1] == "left out, because it is not worn on the head: 'Accessory'"
    assert len(keep_accessories(worn, Placement(), None, HeadSize()).accessories) == 3  # nobody knows where the head is


PAINTED = Material("m", texture=picture(RED), mime="image/png")


def one_hat(bare: list[int], material: Material) -> FitMesh:
    """Two quads that are one hat; those of ``bare`` have no texture coordinates."""
    two = strips([(0, 30, 100), (30, 30, 100)], ("Hat", "b"), material)
    rows = two.face_uv.copy()
    rows[bare] = -1
    return replace(two, face_uv=rows, piece=np.zeros(2, np.int64), pieces=("Hat",), materials=(material,))


def test_quads_without_texture_coordinates_are_kept_in_one_colour():
    kept = keep_accessories(one_hat([0, 1], PAINTED), Placement(), EYES, HeadSize())
    (hat,) = kept.accessories
    assert len(hat.triangles) == 4 and hat.texture == b"" and hat.colour == (*kinds()["hat"].colour, 1.0)
    assert kept.notes == [
        "kept as they are, in one colour: hat 'Hat'",
        "without their texture, some of their faces have no texture coordinates: 'Hat'",
    ]


def test_faces_with_texture_coordinates_keep_their_texture_and_others_get_its_mean_colour():
    kept = keep_accessories(one_hat([1], PAINTED), Placement(), EYES, HeadSize())
    full, bare = kept.accessories
    assert full.texture and not bare.texture and len(full.triangles) == len(bare.triangles) == 2
    assert full.vertices[:, 0].max() < 15 < bare.vertices[:, 0].min()
    np.testing.assert_allclose(bare.colour, (*linear(np.array(RED[:3]) / 255.0), 1.0), atol=1e-6)
    assert kept.notes[0] == "kept as they are, with their texture: hat 'Hat'"
    assert kept.notes[1] == "kept as they are, in one colour: hat 'Hat'"


@pytest.mark.parametrize(("given", "why"), [
    ({"texture": b"\x89PNG broken", "mime": "image/png"}, "its picture cannot be read"),
    ({"texture": None, "lost": "its picture is missing"}, "its picture is missing"), ({"texture": None}, ""),
])  # fmt: skip
@pytest.mark.parametrize(("colour", "wanted"), [
    ((1.0, 1.0, 1.0, 0.5), (*kinds()["hat"].colour, 0.5)), ((0.1, 0.2, 0.3, 1.0), (0.1, 0.2, 0.3, 1.0)),
])  # fmt: skip
def test_a_lost_texture_is_said_and_white_becomes_the_colour_of_the_kind(given, why, colour, wanted):
    kept = keep_accessories(one_hat([], Material("m", colour, **given)), Placement(), EYES, HeadSize())
    (hat,) = kept.accessories
    assert hat.texture == b"" and hat.colour == wanted
    assert kept.notes[0] == "kept as they are, in one colour: hat 'Hat'"
    assert [why in note and "'Hat'" in note for note in kept.notes[1:]] == [True] * bool(why)


def test_grey_beside_a_lost_texture_tells_nothing():
    lost = Material("m", (0.8, 0.8, 0.8, 1.0), lost="its picture is missing")
    for material, wanted in ((lost, kinds()["hat"].colour), (replace(lost, lost=""), (0.8, 0.8, 0.8))):
        (hat,) = keep_accessories(one_hat([], material), Placement(), EYES, HeadSize()).accessories
        assert hat.colour[:3] == wanted


def test_texture_coordinates_far_from_all_others_count_as_none():
    hat = one_hat([], PAINTED)
    uv = hat.uv + 7.25
    uv[4:] += 2e5
    full, bare = keep_accessories(replace(hat, uv=uv), Placement(), EYES, HeadSize()).accessories
    assert full.uv.min() >= 0.0 and full.uv.max() <= 2.0 and len(bare.triangles) == 2
    assert not bare.uv.any()


def test_more_pieces_than_a_head_can_hold_are_kept_within_its_limits():
    names = (*(f"Hair {k}" for k in range(300)), "Hat " + 300 * "a")
    kept = keep_accessories(strips([(0, 30, 100)] * 301, names, PAINTED), Placement(), EYES, HeadSize())
    assert len(kept.accessories) == 2 and fault_of(*kept.accessories) == ""
    assert any("joined" in note for note in kept.notes) and any("cut to 256 letters" in note for note in kept.notes)
    assert set(kept.pieces.values()) == {"hair, kept as it is", "hat, kept as it is"}
    far = replace(strips([(0, 30, 100), (1e6, 0, 0)], ("Hair a", "Hair b"), PAINTED))
    kept = keep_accessories(far, Placement(), EYES, HeadSize())
    assert [one.name for one in kept.accessories] == ["Hair a"] and kept.pieces["Hair b"] == "hair, left out"
    assert "'Hair b'" in kept.notes[-1] and "'Hair b'" not in kept.notes[0]


def test_opacity_counts_only_where_something_is_clear():
    hole = Material("h", texture=picture(RED, hole=True), mime="image/png", alpha="MASK", cutoff=0.3, two_sided=False)
    at = [(0.0, 30.0, 100.0)]
    (one,) = keep_accessories(strips(at, ("Hat",), hole), Placement(), EYES, HeadSize()).accessories
    assert (one.alpha, one.cutoff, one.two_sided) == ("MASK", pytest.approx(0.3), False)
    solid = replace(hole, texture=picture(RED))
    (one,) = keep_accessories(strips(at, ("Hat",), solid), Placement(), EYES, HeadSize()).accessories
    assert one.alpha == "OPAQUE"
    lens = Material("g", (0.1, 0.1, 0.1, 0.4), alpha="BLEND")
    (one,) = keep_accessories(strips(at, ("Glasses",), lens), Placement(), EYES, HeadSize()).accessories
    assert (one.alpha, one.colour, one.texture) == ("BLEND", (0.1, 0.1, 0.1, 0.4), b"")
    (one,) = keep_accessories(strips(at, ("Hair",), hole), Placement(), EYES, HeadSize()).accessories
    assert one.two_sided  # the inside of hair is seen between its locks


def test_normals_are_shared_by_faces_that_meet_softly_and_not_at_an_edge():
    angle = np.radians(30.0)
    points = np.array([[-1.0, 0, 0], [0, 0, 0], [0, 1, 0], [np.cos(angle), 0, -np.sin(angle)]])
    tri = np.array([[0, 1, 2], [1, 3, 2]])
    soft = corner_normals(points, tri)
    np.testing.assert_allclose(soft[0, 1], soft[1, 0])
    assert soft[0, 1, 0] > 0.05 and abs(soft[0, 0, 0]) < 1e-9
    points[3] = [0, 0, -1]
    hard = corner_normals(points, tri)
    np.testing.assert_allclose(hard[0], np.tile([0, 0, 1.0], (3, 1)), atol=1e-9)
    np.testing.assert_allclose(hard[1], np.tile([1.0, 0, 0], (3, 1)), atol=1e-9)


def test_normals_of_large_meshes_are_made_in_blocks(monkeypatch):
    x, y = np.meshgrid(np.arange(9.0), np.arange(9.0))
    points = np.column_stack([x.ravel(), y.ravel(), np.sin(2.0 * x.ravel())])
    k = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
    tri = np.concatenate([np.column_stack([k, k + 1, k + 10]), np.column_stack([k, k + 10, k + 9])])
    whole, sizes, pairs = corner_normals(points, tri), list[int](), accessories._pairs
    monkeypatch.setattr(accessories, "_pairs", lambda *a: (found := pairs(*a), sizes.append(len(found[0])))[0])
    monkeypatch.setattr(accessories, "PAIRS_AT_ONCE", 100)
    np.testing.assert_array_equal(corner_normals(points, tri), whole)
    assert len(sizes) > 10 and max(sizes) <= 200


def test_cards_of_hair_look_outwards_and_are_darker_below_others():
    front = (0.0, 30.0, 110.0)
    worn = strips([front, (0.0, 30.0, 75.0)], ("Hair", "Hair.001"), Material())
    flipped = replace(worn, faces=worn.faces[:, ::-1].copy(), face_uv=worn.face_uv[:, ::-1].copy())
    both = replace(flipped, piece=np.zeros(2, np.int64), pieces=("Hair",), materials=(Material(),))
    (hair,) = keep_accessories(both, Placement(), EYES, HeadSize()).accessories
    assert (hair.normals[:, 2] > 0.5).all()
    outer = hair.vertices[:, 2] > 100
    assert (hair.shade[outer] > 0.95).all() and (hair.shade[~outer] < 0.5 * (1.0 + DARKEST)).all()


@pytest.mark.parametrize(("damage", "why"), [
    ("v 1e30 0 0", "a vertex is not a finite number of usable size"),
    ("v 20.000000 120.000000 10.000000", "all its vertices are in one place"),
    ("f 99999/1 2/1 3/1", "a face points at what is not there"),
    ("f 1/99999 2/1 3/1", "a face points at what is not there"),
])  # fmt: skip
def test_a_damaged_piece_costs_the_head_that_piece_only(tmp_path, damage, why):
    from surface.fit.transfer.scan import read_scan

    path = dressed_file(tmp_path)
    first = len(slit_sheet().vertices) + 4  # of the hat
    for file in (path, tmp_path / "m_shapes" / "jawOpen.obj"):
        lines = file.read_text().splitlines()
        vertices = [k for k, line in enumerate(lines) if line.startswith("v ")][first : first + 4]
        face = lines.index("o Hat") + 2
        for k in [face] if damage.startswith("f") else vertices[: 1 if "20." not in damage else 4]:
            lines[k] = damage
        file.write_text("\n".join(lines) + "\n")
    loaded, scan = load_mesh(path, LoadOptions(unit="mm")), read_scan(path)
    assert [one.name for one in make_accessories(loaded).accessories] == ["Hair/Red"]
    for notes in (loaded.notes, scan.notes):
        assert f"'Hat/Red' left out, because {why}" in notes
    assert scan.worn is not None and len(scan.worn.faces) == 1 and np.abs(scan.vertices).max() < 1e3


@pytest.mark.parametrize(("name", "without", "refused"), [
    ("Face", (), True), ("Hat", ("Boots",), False), ("Boots", (), False),
])  # fmt: skip
def test_a_face_that_points_nowhere_is_named_or_left_out(tmp_path, name, without, refused):
    path = dressed_file(tmp_path)
    lines = path.read_text().splitlines()
    first = next(k for k in range(lines.index(f"o {name}"), len(lines)) if lines[k].startswith("f "))
    path.write_text("\n".join([*lines[:first], "f 99999/1 2/1 3/1", *lines[first + 1 :]]) + "\n")
    if refused:
        with pytest.raises(FitError, match=r"faces\[0\] points at"):
            load_mesh(path, LoadOptions(unit="mm"))
    else:
        loaded = load_mesh(path, LoadOptions(unit="mm", without=without))
        assert any("left out" in note and name in note for note in loaded.notes)


def test_numbers_that_are_none_in_one_piece_leave_the_others():
    two = strips([(0, 30, 100), (30, 30, 100)], ("Hat", "Hair"), Material())
    two.vertices[1, 2] = np.nan
    moved = replace(two, names=("jawOpen",), deltas=np.full((1, 8, 3), np.nan))  # as a shape minus what is none
    assert worn_faces(replace(moved, pieces=("Hat", "Face"))).tolist() == [True, False]
    worn, notes = worn_mesh(moved, np.ones(2, bool), "m")
    assert worn is not None and len(worn.faces) == 1 and np.isfinite(worn.vertices).all()
    assert notes == ["'Hat' left out, because a vertex is not a finite number of usable size"]
    assert worn_mesh(moved, np.array([True, False]), "m")[0] is None


def test_a_scan_keeps_them_too(tmp_path):
    from surface.fit.transfer.scan import read_scan

    scan = read_scan(dressed_file(tmp_path))
    assert scan.worn is not None and scan.worn.pieces[:1] == ("Face",) and len(scan.worn.faces) == 2
    assert scan.notes == ("boots left out: 'Boots/Red'",)
    assert read_scan(tmp_path / "m.obj", ("Hair", "Hat")).worn is None
