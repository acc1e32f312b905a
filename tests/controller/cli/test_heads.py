"""``omote fit`` and ``omote export`` as a user types them."""

import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from controller.base.errors import ConfigError, ParameterError
from controller.cli.app import make_app
from surface.base.errors import ExportError, FitError, HeadFileError

SURFACE = str(Path(__file__).parents[2] / "surface")


@pytest.fixture(scope="module")
def sheet(tmp_path_factory):
    """A fitted sheet: its GLB, its head folder, what the command said."""
    sys.path.insert(0, SURFACE)
    try:
        from meshfiles import glb
        from slit_sheet import slit_sheet
    finally:
        sys.path.remove(SURFACE)
    folder = tmp_path_factory.mktemp("fit")
    mesh, head = folder / "me.glb", folder / "me"
    mesh.write_bytes(glb(slit_sheet()).bytes())
    said = CliRunner().invoke(make_app(), ["fit", str(mesh), "-o", str(head), "--report", str(folder / "report")])
    assert said.exit_code == 0, said.output
    return mesh, head, said.output


def test_fit_says_what_it_did_and_guessed(sheet):
    mesh, head, output = sheet
    words = " ".join(output.split())
    for expected in ("me: ", "2 shapes", "unit taken for m: all of it is 200 mm high", "no shape for", f"wrote {head}"):
        assert expected in words
    assert (mesh.parent / "report" / "report.md").is_file()


def test_export_writes_what_fit_wrote(sheet, tmp_path):
    out = tmp_path / "out.glb"
    said = CliRunner().invoke(make_app(), ["export", str(out), "--head", str(sheet[1]), "--set", "jawOpen=0.5"])
    assert said.exit_code == 0 and out.read_bytes()[:4] == b"glTF", said.output
    back = CliRunner().invoke(make_app(), ["export", str(tmp_path / "out.obj"), "--head", str(sheet[1])])
    assert back.exit_code == 0 and "out_shapes" in back.output.replace("\n", "")


@pytest.mark.parametrize(
    ("words", "kind", "message"),
    [
        (["export", "x.fbx"], ExportError, "is neither .glb nor .obj"),
        (["export", "x.glb", "--set", "jawOpn=1"], ParameterError, "jawOpn"),
        (["fit", "none.glb", "-o", "h"], FitError, "no such mesh file"),
        (["fit", "none.glb", "-o", "h", "--unit", "ell"], FitError, "no such mesh file"),
        (["fit", "none.glb", "-o", "h", "--keep"], ConfigError, "--keep: fits nothing"),
        (["fit", "none.glb", "-o", "/dev/null/h"], HeadFileError, "/dev/null is no folder"),
    ],
)
def test_mistakes_leave_nothing_behind(tmp_path, monkeypatch, words, kind, message):
    monkeypatch.chdir(tmp_path)
    said = CliRunner().invoke(make_app(), words)
    assert isinstance(said.exception, kind) and message in str(said.exception)
    assert list(tmp_path.iterdir()) == []


def test_a_damaged_mesh_leaves_the_old_head(sheet, tmp_path):
    mesh, head, _ = sheet
    before = (head / "head.npz").read_bytes()
    bad = tmp_path / "bad.glb"
    bad.write_bytes(mesh.read_bytes()[:9000])
    said = CliRunner().invoke(make_app(), ["fit", str(bad), "-o", str(head), "--report", str(tmp_path / "r")])
    assert isinstance(said.exception, FitError) and "bad.glb" in str(said.exception)
    assert (head / "head.npz").read_bytes() == before and not (tmp_path / "r").exists()
