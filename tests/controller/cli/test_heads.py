"""``omote fit`` and ``omote export`` as a user types them."""

import io
import json
import struct
import sys
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import PARAMETERS
from controller.cli.app import make_app
from controller.cli.console import console
from surface.base.errors import ExportError, FitError, HeadFileError, ViewError
from surface.fit.points.report import DenseErrors, Errors, Spot
from surface.fit.source.load import LoadOptions
from surface.head.model.file import save_data
from tests.surface.small_head import part, small_head

SURFACE = str(Path(__file__).parents[2] / "surface")


@pytest.fixture(scope="module")
def sheet(tmp_path_factory):
    """A fitted sheet: its GLB, its head folder, what the command said."""
    sys.path.insert(0, SURFACE)
    try:
        from fewer_points import fewer_points
        from meshfiles import glb
        from slit_sheet import slit_sheet
    finally:
        sys.path.remove(SURFACE)
    folder = tmp_path_factory.mktemp("fit")
    mesh, head = folder / "me.glb", folder / "me"
    mesh.write_bytes(glb(slit_sheet()).bytes())
    with fewer_points():
        said = CliRunner().invoke(make_app(), ["fit", str(mesh), "-o", str(head), "--report", str(folder / "report")])
    assert said.exit_code == 0, said.output
    return mesh, head, said.output


@pytest.mark.slow
def test_fit_says_what_it_did_and_guessed(sheet):
    mesh, head, output = sheet
    words = " ".join(output.split())
    for expected in (
        "me: ",
        "2 shapes",
        "placed: the file's unit is m, up is y",
        "no eyes",
        "no shape for",
        f"wrote {head}",
    ):
        assert expected in words
    assert (mesh.parent / "report" / "report.md").is_file()


@pytest.mark.slow
def test_export_writes_what_fit_wrote(sheet, tmp_path):
    out = tmp_path / "out.glb"
    said = CliRunner().invoke(make_app(), ["export", str(out), "--head", str(sheet[1]), "--set", "jawOpen=0.5"])
    assert said.exit_code == 0 and out.read_bytes()[:4] == b"glTF", said.output
    back = CliRunner().invoke(make_app(), ["export", str(tmp_path / "out.obj"), "--head", str(sheet[1])])
    assert back.exit_code == 0 and "out_shapes" in back.output.replace("\n", "")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "kind", "message"),
    [
        (["export", "x.fbx"], ExportError, "is neither .glb, .obj nor .urdf"),
        (["export", "x.glb", "--set", "jawOpn=1"], ParameterError, "jawOpn"),
        (["fit", "none.glb", "-o", "h"], FitError, "no such mesh file"),
        (["fit", "none.glb", "-o", "h", "--unit", "ell"], FitError, "no such mesh file"),
        (["fit", "none.glb", "-o", "h", "--keep"], HeadFileError, "h: no such head folder"),
        (["fit", "none.glb", "-o", "/dev/null/h"], HeadFileError, "/dev/null is no folder"),
    ],
)
def test_mistakes_leave_nothing_behind(tmp_path, monkeypatch, words, kind, message):
    monkeypatch.chdir(tmp_path)
    said = CliRunner().invoke(make_app(), words)
    assert isinstance(said.exception, kind) and message in str(said.exception)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_damaged_mesh_leaves_the_old_head(sheet, tmp_path):
    mesh, head, _ = sheet
    before = (head / "head.npz").read_bytes()
    bad = tmp_path / "bad.glb"
    bad.write_bytes(mesh.read_bytes()[:9000])
    said = CliRunner().invoke(make_app(), ["fit", str(bad), "-o", str(head), "--report", str(tmp_path / "r")])
    assert isinstance(said.exception, FitError) and "bad.glb" in str(said.exception)
    assert (head / "head.npz").read_bytes() == before and not (tmp_path / "r").exists()


class Terminal(io.StringIO):
    """A file that says it is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def fitted(monkeypatch):
    """Calls of the fit, in place of fitting: what it was given, and a report that a test may change."""
    neutral = Errors(rms=0.1234, p99=0.5678, max=1.2345)
    part = SimpleNamespace(name="face", points=77, neutral=neutral, mean_shape_rms=0.0456)
    report = SimpleNamespace(name="me", points=123, parameters=["a", "b"], parts=[part], missing=[], left_out=[],
                             notes=["a note [x]"], dense=None, pieces={}, faults=())  # fmt: skip
    calls = []

    def fit_head(mesh, out, *, name, progress, options, report_dir, force):
        report.forced = force
        calls.append((mesh, out, name, options, report_dir))
        progress("face", 0.5)
        progress("report", 0.75)
        return report

    def shade(out):
        calls.append(("shade", out))
        if report.notes == []:
            raise ViewError("no OpenGL")

    monkeypatch.setattr("surface.fit.api.fit_head", fit_head)
    monkeypatch.setattr("surface.fit.points.report.face_bounds", lambda found: "face: 1.2 mm [max]")
    monkeypatch.setattr("controller.cli.heads._check_lines", lambda out: [])
    monkeypatch.setattr("surface.view.draw.decimate.decimate_head", lambda out: calls.append(("decimate", out)))
    monkeypatch.setattr("surface.view.draw.grain.grain_head", lambda out: calls.append(("grain", out)))
    monkeypatch.setattr("surface.view.pictures.occlusion.shade_head", shade)
    monkeypatch.setattr(
        "surface.fit.identities.add_identities",
        lambda out, mesh, file: calls.append(("identities", out, mesh, file)) or ["broad", "long"],
    )
    return calls, report


def test_fit_passes_its_options_on_and_tells_the_errors(fitted, tmp_path, monkeypatch):
    calls, report = fitted
    out = tmp_path / "mine"
    said = CliRunner().invoke(make_app(), ["fit", "a.glb", "-o", str(out)])
    assert said.exit_code == 0
    assert calls == [(Path("a.glb"), out, "mine", LoadOptions(None, None, None, None, None, ()), None),
                     ("decimate", out), ("grain", out), ("shade", out)]  # fmt: skip
    words = " ".join(said.output.replace("│", " ").replace("┃", " ").split())
    assert "me: 123 control points, 2 shapes" in words
    assert "part control points RMS 99 % max mean RMS of shapes" in words
    assert "face 77 0.123 0.568 1.234 0.046" in words
    assert words.endswith(f"face: 1.2 mm [max] a note [x] wrote {out}")
    worst = Spot(1.234, "jawOpen", "face", "left cheek", False)
    report.dense = DenseErrors({}, worst, None, ("eye_left",), ("hat (3 faces)",), 99)
    said = CliRunner().invoke(make_app(), ["fit", "a.glb", "-o", str(out)])
    lines = said.output.splitlines()
    assert lines[-2] == "greatest error 1.23 mm: shape jawOpen, left cheek (face, mesh to surface)"
    assert lines[-3] == "not in the mesh, so not measured: eye_left" and "hat (3 faces)" in lines[-4]
    report.dense = None
    calls.clear()
    report.missing, report.left_out, report.notes = ["jawOpen", "noseSneer"], ["x", "y"], []
    more = ["--name", "you", "--shapes", "s", "--names", "n.toml", "--unit", "cm", "--up", "z", "--forward", "-y"]
    more += ["--without", "hair", "--without", "hat", "--report", "r", "--identities", "i.npz"]
    said = CliRunner().invoke(make_app(), ["fit", "a.glb", "-o", str(out), *more])
    options = LoadOptions(Path("s"), Path("n.toml"), "cm", "z", "-y", ("hair", "hat"))
    assert calls[0] == (Path("a.glb"), out, "you", options, Path("r"))
    assert calls[-1] == ("identities", out, Path("a.glb"), Path("i.npz"))
    lines = [line for line in said.output.splitlines() if line][-6:]
    assert lines == [
        "face: 1.2 mm [max]",
        "no shape for jawOpen, noseSneer: these parameters will not move this head",
        "left out, not ARKit's: x, y",
        "no OpenGL here: the head has no baked shading; for a better picture, fit it on a machine with OpenGL",
        f"wrote {out}",
        "identities: broad, long",
    ]
    report.parameters = ["eyeLookUpLeft"]
    said = CliRunner().invoke(make_app(), ["fit", "a.glb", "-o", str(out)])
    hint = (
        "the mesh has few shapes of a face, or none: with --expressions-from ict, the head gets those that it lacks, "
        "and keeps its own"
    )
    assert hint in said.output.splitlines() and hint not in lines
    calls.clear()
    measured = {"face": np.array([0.1, 0.3, np.nan]), "back": np.array([2.0])}
    monkeypatch.setattr("surface.fit.api.measure_head", lambda *given: calls.append(("measured", *given)) or measured)
    said = CliRunner().invoke(make_app(), ["fit", "a.glb", "-o", str(out), "--keep", "--identities", "i.npz"])
    assert said.output.endswith("identities: broad, long\n") and [call[0] for call in calls] == [
        "measured",
        "identities",
    ]
    assert "face 2 0.224 0.298 0.300" in " ".join(said.output.replace("\u2502", " ").split())


def test_a_fit_can_be_forced_and_then_says_what_is_wrong(fitted, tmp_path, monkeypatch):
    _, report = fitted
    words = ["fit", "a.glb", "-o", str(tmp_path / "mine")]
    assert CliRunner().invoke(make_app(), words).exit_code == 0 and not report.forced
    report.faults = ("48 mm off", "all turned over")
    monkeypatch.setattr("controller.cli.heads._check_lines", lambda out: [f"check: {out.name} has a spike"])
    said = CliRunner().invoke(make_app(), [*words, "--force"])
    assert report.forced
    wanted = ["written by --force: 48 mm off", "written by --force: all turned over", "check: mine has a spike"]
    assert said.output.splitlines()[-4:-1] == wanted
    refused = CliRunner().invoke(make_app(), ["fit", "a.3dm", "-o", str(tmp_path / "mine"), "--force"])
    assert isinstance(refused.exception, ConfigError) and "--force: " in str(refused.exception)


def test_a_transfer_can_be_forced_too(tmp_path, monkeypatch):
    heard = []
    monkeypatch.setattr("controller.tools.transfer.transfer_head", lambda *a, **given: heard.append(given) or 1 / 0)
    words = ["fit", "a.ply", "-o", str(tmp_path / "mine"), "--expressions-from", "ict"]
    for more in ([], ["--force"]):
        assert isinstance(CliRunner().invoke(make_app(), [*words, *more]).exception, ZeroDivisionError)
    assert [given["force"] for given in heard] == [False, True]


def test_a_mesh_with_shapes_keeps_them_in_a_transfer(tmp_path, monkeypatch):
    heard = []
    monkeypatch.setattr("controller.tools.transfer.shapes_in", lambda *_: ("jawOpen",))
    monkeypatch.setattr("controller.tools.transfer.fit_head", lambda *_, **given: heard.append("filled") or 1 / 0)
    monkeypatch.setattr("controller.tools.transfer.transfer_head", lambda *_, **given: heard.append("all") or 1 / 0)
    words = ["fit", "a.glb", "-o", str(tmp_path / "mine"), "--expressions-from", "ict"]
    for more in ([], ["--no-own-shapes"]):
        assert isinstance(CliRunner().invoke(make_app(), [*words, *more]).exception, ZeroDivisionError)
    assert heard == ["filled", "all"]


@pytest.mark.slow
def test_a_fit_ends_with_what_a_check_says(sheet):
    _, head, output = sheet
    said = CliRunner().invoke(make_app(), ["check", str(head)])
    assert isinstance(said.exception, ConfigError) and "unsealed lips: the neutral face" in str(said.exception)
    assert "check: unsealed lips: the neutral face" in " ".join(output.split())


def test_a_terminal_keeps_no_bar_of_a_fit(fitted, tmp_path, monkeypatch):
    out = Terminal()
    monkeypatch.setattr(console, "_file", out)  # its property would bind the standard output of this moment
    monkeypatch.setattr(console, "is_interactive", True)
    assert CliRunner().invoke(make_app(), ["fit", "a.glb", "-o", str(tmp_path / "mine")]).exit_code == 0
    text = out.getvalue()
    assert "writing the report" in text
    after = text.rpartition("writing the report")[2].partition("finding")[0]
    assert "\x1b[2K" in after  # the line is erased before the next thing is told


def test_render_draws_a_picture_unless_a_sheet_is_asked_for(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("controller.face.still.draw_still", lambda still, out: drawn.append(("still", still, out)))
    monkeypatch.setattr(
        "controller.face.still.draw_sheet",
        lambda still, out, progress: (progress(1, 2), drawn.append(("sheet", still, out))),
    )
    out = tmp_path / "a.png"
    assert CliRunner().invoke(make_app(), ["render", "-o", str(out)]).output.replace("\n", "") == f"wrote {out}"
    words = ["--sheet", "--size", "64x32", "--theme", "mask", "--quality", "fast", "--background", "#ff0000"]
    words += ["--set", "jawOpen=0.5", "-e", "happiness=0.5", "--camera", "profile", "--identity", "broad=0.5"]
    assert CliRunner().invoke(make_app(), ["render", "-o", str(out), *words]).exit_code == 0
    (first, plain, _), (second, other, target) = drawn
    assert (first, second, target) == ("still", "sheet", out)
    assert (plain.size, plain.head.name, plain.identity, plain.groups) == ((800, 800), "ict", {}, ())
    assert not plain.values.any()
    assert (other.size, other.look.theme, other.look.quality, other.look.camera) == (
        (64, 32),
        "mask",
        "fast",
        "profile",
    )
    assert other.identity == {"broad": 0.5} and other.values[PARAMETERS.index("jawOpen")] == 0.5
    assert other.values[PARAMETERS.index("mouthSmileLeft")] > 0.1
    assert plain.look.background != other.look.background


def test_render_draws_a_crowd_or_a_sheet(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(
        "controller.face.still.draw_crowd", lambda still, count, out, progress: drawn.append((count, out))
    )
    out = tmp_path / "a.png"
    assert CliRunner().invoke(make_app(), ["render", "-o", str(out), "--crowd", "64"]).exit_code == 0
    assert drawn == [(64, out)]
    both = CliRunner().invoke(make_app(), ["render", "-o", str(out), "--crowd", "2", "--sheet"])
    assert both.exit_code != 0 and len(drawn) == 1


@pytest.mark.slow
def test_export_poses_what_is_set_and_asks_exporters_of_others(tmp_path, monkeypatch, sheet):
    calls = []
    other = SimpleNamespace(kind="odd", suffixes=(".odd",))
    monkeypatch.setattr("controller.tools.plugins.added_exporters", lambda: [other])
    monkeypatch.setattr(
        "surface.export.export_head",
        lambda head, out, pose, added, frame, animation, web: (
            calls.append((head.name, out, pose, added, frame, web)) or [out, tmp_path / "more"]
        ),
    )
    blamed = []
    monkeypatch.setattr(
        "controller.tools.plugins.EXPORTERS.naming_package", lambda kind: blamed.append(kind) or nullcontext()
    )
    head = ["--head", str(sheet[1])]
    said = CliRunner().invoke(make_app(), ["export", "a.ODD", *head, "--set", "jawOpen=0.5", "--set", "headYaw=0"])
    assert said.exit_code == 0, said.exception
    assert calls == [("me", Path("a.ODD"), {"jawOpen": 0.5}, [other], "head", False)]
    assert said.output.replace("\n", "") == f"wrote a.ODDwrote {tmp_path / 'more'}"
    assert CliRunner().invoke(make_app(), ["export", "b.glb", *head]).exit_code == 0
    assert calls[1][2] == {} and blamed == ["odd", ""]


def content(path):
    """The document of a .glb and its binary chunk."""
    raw = path.read_bytes()
    size = struct.unpack_from("<I", raw, 12)[0]
    return json.loads(raw[20 : 20 + size]), raw[28 + size :]


def test_export_has_the_groups_of_a_vocabulary_and_their_motion(tmp_path):
    save_data(tmp_path / "small", small_head(parts=[part("face", -40)], seams=[], paint=[]))
    (tmp_path / "ear.json").write_text('{"format": 1, "part": "face", "ids": [12], "moves_mm": [[0, 3, 0]]}')
    vocabulary = tmp_path / "ears.toml"
    vocabulary.write_text('[parameters.earLeft]\nregion = "mouth"\nprofile = "mouth"\ngroup = "ear.json"\n')
    (tmp_path / "twitch.csv").write_text("time,earLeft\n0,0\n0.5,1\n1,0.25\n")
    out = tmp_path / "out.glb"
    words = ["export", str(out), "--head", str(tmp_path / "small"), "--vocabulary", str(vocabulary)]
    said = CliRunner().invoke(make_app(), [*words, "--take", str(tmp_path / "twitch.csv"), "--rate", "2"])
    assert said.exit_code == 0, said.output
    document, data = content(out)
    (sampler,) = document["animations"][0]["samplers"]
    view = document["bufferViews"][document["accessors"][sampler["output"]]["bufferView"]]
    assert np.frombuffer(data, "<f4", 3, view["byteOffset"]).tolist() == [0.0, 1.0, 0.25]
    assert CliRunner().invoke(make_app(), [*words, "--set", "earLeft=0.5"]).exit_code == 0
    (mesh,) = content(out)[0]["meshes"]
    assert (mesh["extras"]["targetNames"], mesh["weights"]) == (["earLeft"], [0.5])


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["--name", "you"], "change name in {out}/head.toml"),
        (["--report", "r"], "a report needs a new fit: omote fit a.glb -o OTHER_FOLDER --report r"),
        (["--force"], "leave it out, or leave out --keep to write the head again"),
    ],
)
def test_what_needs_a_new_head_is_refused_for_one_that_is_kept(fitted, tmp_path, words, hint):
    """They were ignored without a word."""
    calls, _ = fitted
    said = CliRunner().invoke(make_app(), ["fit", "a.glb", "-o", str(tmp_path / "mine"), "--keep", *words])
    assert isinstance(said.exception, ConfigError) and calls == []
    assert str(said.exception).startswith(f"{words[0]}: cannot be used with --keep")
    assert said.exception.hint == hint.format(out=tmp_path / "mine")
