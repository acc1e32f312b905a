"""Kinds of pieces by their names, in the spelling of several makers; and what is worn is left out."""

from dataclasses import replace

import numpy as np
import pytest
from slit_sheet import slit_sheet

from surface.fit.source.kinds import (
    is_known,
    kind_name,
    kind_of,
    kinds,
    listed,
    material_of,
    piece_kinds,
    skin_and_eyes,
    without_clothes,
    worn_faces,
)
from surface.fit.source.mesh import FitMesh

NAMES = {
    "skin": [
        "Head", "Wolf3D_Head/Wolf3D_Skin", "Wolf3D_Body/Wolf3D_Body", "Body/N00_000_00_Body_00_SKIN (Instance)",
        "Face/N00_000_00_Face_00_SKIN", "CC_Base_Body/Std_Skin_Head", "CC_Base_Body/Std_Nails", "head_lod0_mesh",
        "EyeSocket", "Eyelid_L", "Popeye", "BrownSkin", "Shirt/Std_Skin_Body", "Mesh", "Sphere.002", "", "顔", "kao",
    ],
    "eye": ["EyeLeft/Wolf3D_Eye", "helper-l-eye", "Human.high-poly", "eyeLeft_lod0_mesh", "Std_Eye_L", "目"],
    "eye_white": ["Face/N00_000_00_EyeWhite_00_EYE", "Sclera", "shirome", "白目"],
    "iris": ["Face/N00_000_00_EyeIris_00_EYE", "Irises", "hitomi", "瞳"],
    "highlight": ["Face/N00_000_00_EyeHighlight_00_EYE", "eye_highlight"],
    "eye_cover": ["Std_Cornea_L", "CC_Base_EyeOcclusion/Std_Eye_Occlusion_L", "TearLine", "eyeshell_lod0", "EyeWet"],
    "lash": ["EyeLashes_L", "Face/N00_000_00_FaceEyeline_00_FACE", "helper-l-eyelashes-1", "Std_Eyelash", "matsuge"],
    "brow": ["eyebrow001", "Face/N00_000_00_FaceBrow_00_FACE", "mayu", "眉毛"],
    "hair": ["HAIR", "Hair001/N00_000_Hair_00_HAIR", "HairBack", "Wolf3D_Hair/Wolf3D_Hair", "前髪", "ponytail01"],
    "beard": ["Beard.001", "Wolf3D_Beard", "hige"],
    "teeth": ["lower_teeth", "Tooth12", "Wolf3D_Teeth", "Std_Upper_Teeth", "teeth_base", "lowerteethmesh", "歯"],
    "gums": ["Gums"],
    "tongue": ["MyTongue/pink", "tongue01", "CC_Base_Tongue/Std_Tongue", "舌"],
    "mouth": ["mouth_bag", "OralCavity", "Face/N00_000_00_FaceMouth_00_FACE", "saliva_lod0"],
    "glasses": ["Wolf3D_Glasses/x", "Sunglasses", "megane"],
    "hat": ["Wolf3D_Headwear", "fedora", "Cap01", "帽子"],
    "clothes": ["Wolf3D_Outfit_Top", "Body/N00_010_01_Onepiece_00_CLOTH_01", "male_casualsuit01", "服"],
    "boots": ["Wolf3D_Outfit_Footwear", "Body/N00_008_01_Shoes_01_CLOTH_01 (Instance)", "shoes01", "kutsu"],
    "prop": ["joint-head", "joint-tongue-4", "helper-tights", "helper-hair", "chair"],
}  # fmt: skip


@pytest.mark.parametrize(("name", "kind"), [(n, kind) for kind, every in NAMES.items() for n in every])
def test_names_of_many_makers(name, kind):
    assert kind_name(name) == kind


def test_every_kind_has_a_rule_and_every_entry_is_read_as_its_kind():
    assert {k.rule for k in kinds().values()} == {"skin", "part", "eye", "out"}
    assert {k.material for k in kinds().values()} == {"skin", "lash", "brow", "teeth", "gums", "tongue", "mouth"}
    from surface.fit.source.kinds import _table

    for kind, row in _table().items():
        assert {word: kind_name(word) for word in row["words"]} == dict.fromkeys(row["words"], kind)


def test_the_material_decides_but_skin_is_no_kind_of_hair():
    assert kind_name("Face/HairMaterial") == "hair" and kind_name("Hair/Material.001") == "hair"
    assert kind_name("Teeth/Std_Skin") == "teeth" and kind_name("Top/Skin") == "skin"
    assert material_of("Hair") == "brow" and material_of("EyeIris") == material_of("Shirt") == "skin"
    assert kind_of("EyeIris").rule == "eye"
    assert is_known("Body/xyz") and is_known("Head") and not is_known("Mesh/Material.001")


def two_pieces(name: str, moves: float) -> FitMesh:
    """A sheet whose upper half has a name of its own, and moves by so many mm in a shape that moves the rest by 10."""
    mesh = slit_sheet()
    upper = (mesh.vertices[mesh.faces].mean(axis=1)[:, 1] > 0).astype(int)
    share = np.full(len(mesh.vertices), 10.0)
    share[np.unique(mesh.faces[upper == 1])] = moves
    delta = np.zeros((1, len(mesh.vertices), 3))
    delta[0, :, 2] = share
    return replace(mesh, piece=upper, pieces=("face", name), names=("jawOpen",), deltas=delta)


def test_what_is_worn_is_left_out_and_said():
    mesh = two_pieces("Jacket", 1.0)
    kept, notes = without_clothes(mesh)
    np.testing.assert_array_equal(kept, mesh.piece == 0)
    assert notes == ["clothes left out: 'Jacket'"]
    piece, names = np.minimum(np.arange(len(mesh.faces)) // 8, 9), ("face", *["Shirt", "Boots"] * 4, "x")
    many = replace(mesh, piece=piece, pieces=names, names=(), deltas=mesh.deltas[:0])
    shirts = "'Shirt', 'Shirt', 'Shirt', 'Shirt'"
    assert without_clothes(many)[1] == [
        f"clothes left out: {shirts}",
        f"boots left out: {shirts.replace('Shirt', 'Boots')}",
    ]
    assert listed(list("abcdef")) == "'a', 'b', 'c', 'd' and 2 more"
    assert without_clothes(two_pieces("Hair", 1.0))[0].all() and without_clothes(two_pieces("neck", 1.0))[1] == []


def test_names_are_not_believed_against_what_shapes_do():
    kept, notes = without_clothes(two_pieces("Hoodie", 8.0))
    assert kept.all() and notes == ["'Hoodie': named as clothes, but shapes move it: kept as skin"]
    mesh = two_pieces("Hat", 0.0)
    kept, notes = without_clothes(replace(mesh, pieces=("Mask_Shirt", "Hat"), names=(), deltas=mesh.deltas[:0]))
    assert kept.all() and notes == []  # nothing would be left


def test_a_cube_at_a_joint_is_no_part_of_a_face_that_moves_with_it():
    mesh = slit_sheet()
    for faces, left_out in ((len(mesh.faces) // 200, True), (len(mesh.faces) // 50, False)):
        piece = (np.arange(len(mesh.faces)) >= len(mesh.faces) - max(faces, 1)).astype(int)
        near = mesh.faces[piece == 1]
        deltas = np.zeros_like(mesh.deltas)
        deltas[:, near[near >= 0]] = 5.0
        kept, notes = without_clothes(replace(mesh, piece=piece, pieces=("face", "joint-jaw"), deltas=deltas))
        np.testing.assert_array_equal(kept, (piece == 0) | (not left_out))
        assert notes[0].startswith("prop left out" if left_out else "'joint-jaw': named as prop")
        assert without_clothes(replace(mesh, piece=piece, pieces=("face", "Hoodie"), deltas=deltas))[0].all()


def test_meshes_without_pieces_are_kept():
    assert without_clothes(slit_sheet())[0].all()


def test_only_skin_and_eyes_are_left_where_there_are_any():
    mesh = slit_sheet()
    piece = np.arange(len(mesh.faces)) % 4
    every = np.ones(len(mesh.faces), bool)
    mesh = replace(mesh, piece=piece, pieces=("Head", "EyeLeft", "Hair", "Shirt"))
    own, notes = skin_and_eyes(mesh, every)
    np.testing.assert_array_equal(own, piece < 2)
    assert notes == ["hair left out: 'Hair'", "clothes left out: 'Shirt'"]
    own, notes = skin_and_eyes(mesh, piece != 2)
    np.testing.assert_array_equal(own, piece < 2)
    assert notes == ["clothes left out: 'Shirt'"]  # nothing is said of what was left out before
    bald = replace(mesh, pieces=("Beard", "Tongue", "Hair", "Shirt"))
    own, notes = skin_and_eyes(bald, piece < 3)
    np.testing.assert_array_equal(own, piece < 3)
    assert notes == []
    assert every.all()


def test_objects_are_told_by_kind_and_whether_they_are_left_out():
    mesh = slit_sheet()
    piece = np.arange(len(mesh.faces)) % 3
    mesh = replace(mesh, piece=piece, pieces=("Head", "Sclera", "Shirt", "Boots"))
    told = {"Head": "skin", "Sclera": "eye white", "Shirt": "clothes, left out"}
    assert piece_kinds(mesh, piece < 2) == told  # no face is of boots
    some = (piece == 0) | (np.arange(len(piece)) == 4)
    assert piece_kinds(mesh, some) == told


@pytest.mark.parametrize(("moves", "kept"), [(5.0, True), (4.99, False), (12.0, True)])
def test_a_piece_that_moves_half_as_far_as_the_face_belongs_to_it(moves, kept):
    assert without_clothes(two_pieces("Shirt", moves))[0].all() == kept


def test_of_five_names_or_more_four_are_listed():
    assert listed(list("abcd")) == "'a', 'b', 'c', 'd'"
    assert listed(list("abcde")) == "'a', 'b', 'c', 'd' and 1 more"
    assert listed(["a"]) == "'a'"


@pytest.mark.parametrize(("name", "kind"), [
    ("xxteethxx", "skin"), ("xxteeth", "teeth"), ("teethxx", "teeth"), ("gumsxx", "skin"), ("xxhair", "hair"),
    ("hairxx", "skin"), ("xxlash", "lash"), ("Skin Teeth", "teeth"), ("Teeth Joint", "prop"), ("Hair Teeth", "teeth"),
    ("Gums Hair", "hair"), ("Hair Gums", "gums"),
])  # fmt: skip
def test_words_count_by_their_length_and_place(name, kind):
    assert kind_name(name) == kind


def test_hair_hats_glasses_and_jewellery_are_kept_as_they_are_unless_shapes_move_them():
    for name in ("Hair", "Hat", "Glasses", "Necklace"):
        mesh = two_pieces(name, 0.2)
        np.testing.assert_array_equal(worn_faces(mesh), mesh.piece == 1)
        kept, notes = without_clothes(mesh, worn_faces(mesh))
        np.testing.assert_array_equal(kept, mesh.piece == 0)
        assert notes == []
        assert not worn_faces(two_pieces(name, 6.0)).any()
    assert not worn_faces(two_pieces("Hair", 1.0)).any()  # a tenth of the motion is enough: it would stay behind
    assert worn_faces(two_pieces("Hat", 1.0)).any()
    for name in ("Beard", "Boots", "Shirt", "helper-hair", "Brow"):
        assert not worn_faces(two_pieces(name, 0.0)).any()


def test_a_mesh_of_nothing_else_is_not_worn():
    mesh = replace(two_pieces("Hair", 0.0), names=(), deltas=np.zeros((0, 625, 3)))
    assert not worn_faces(replace(mesh, pieces=("Hat", "Hair"))).any()
    boots = replace(mesh, pieces=("Boots", "Hair"))
    kept, _ = without_clothes(boots, worn_faces(boots))
    np.testing.assert_array_equal(kept, boots.piece == 0)
