"""surface.readers.mtl: colours beside an OBJ; nothing in them refuses a mesh."""

import pytest

from surface.readers.meshdata import Material
from surface.readers.obj import read_obj

PNG = b"\x89PNG\r\n\x1a\n and the rest"
OBJ = """mtllib {library}
v 0 0 0
v 1 0 0
v 0 1 0
o Head
usemtl Skin
f 1 2 3
usemtl Eye
f 1 3 2
usemtl Lost
f 2 1 3
"""


def materials(folder, mtl: str | None, library: str = "m.mtl") -> tuple[Material | None, ...]:
    (folder / "m.obj").write_text(OBJ.format(library=library))
    if mtl is not None:
        (folder / library).write_text(mtl)
    return read_obj(folder / "m.obj").materials


def test_colours_and_textures_go_to_the_pieces_that_use_them(tmp_path):
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "skin 1.png").write_bytes(PNG)
    skin, eye, lost = materials(
        tmp_path, "newmtl Eye\nKd 0.1 0.2 0.3\nd 0.5\n\nnewmtl Skin\nKd 0.6 0.6 0.6\nmap_Kd maps\\skin 1.png\n"
    )
    assert skin == Material("Skin", (1.0, 1.0, 1.0, 1.0), PNG, "image/png") and lost is None
    assert eye == Material("Eye", (0.1, 0.2, 0.3, 0.5), alpha="BLEND")


def test_options_before_the_file_of_a_texture_are_passed_over(tmp_path):
    (tmp_path / "a.png").write_bytes(PNG)
    skin, *_ = materials(tmp_path, "newmtl Skin\nmap_Kd -s 1 1 1 a.png\nTr 0.25", "with space.mtl")
    assert skin == Material("Skin", (1.0, 1.0, 1.0, 0.75), PNG, "image/png", "BLEND")


@pytest.mark.parametrize("mtl", [
    None, "", "Kd 1 1 1", "newmtl Other", "\0\0", "newmtl Skin\nKd a b\nd\nmap_Kd ../up.png",
    "newmtl Skin\nmap_Kd no.png",
])  # fmt: skip
def test_damage_is_left_out(tmp_path, mtl):
    folder = tmp_path / "in"
    folder.mkdir()
    (tmp_path / "up.png").write_bytes(PNG)
    found = materials(folder, mtl)
    assert found == () or {m for m in found if m} <= {Material("Skin")}


def test_a_texture_that_cannot_be_read_is_said_with_its_name(tmp_path):
    (tmp_path / "b.dds").write_bytes(b"DDS ")
    for name in ("no.png", "b.dds"):
        skin, *_ = materials(tmp_path, f"newmtl Skin\nmap_Kd {name}")
        assert skin.texture is None and "no PNG, JPEG or WebP" in skin.lost and skin.lost.endswith(name)
    assert materials(tmp_path, "newmtl Skin\nKd 1 1 1")[0].lost == ""


@pytest.mark.parametrize("library", ["../m.mtl", "/etc/passwd", "none.mtl"])
def test_only_files_beside_are_opened(tmp_path, library):
    folder = tmp_path / "in"
    folder.mkdir()
    (tmp_path / "m.mtl").write_text("newmtl Skin\nKd 0 0 0")
    assert materials(folder, None, library) == ()
