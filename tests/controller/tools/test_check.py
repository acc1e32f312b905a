"""``omote check`` finds out what a file is: surface files, and JSON that is a surface or speech."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from controller.base.errors import ConfigError, ControllerError, TakeError
from controller.base.parameters import PARAMETERS
from controller.base.paths import config_dir
from controller.cli.app import make_app
from controller.layers.commands import CommandState
from controller.robot.calibration import CapturedAngles, save_calibration
from controller.takes.recording import recorded
from controller.tools.check import check_anything
from controller.vocabulary.vocabulary import Vocabulary
from surface import DCPSurface, Domain, Slit, SurfaceFileError
from surface.base.errors import HeadFileError
from surface.head import Head
from surface.head.model.data import with_greatest_error
from surface.head.model.file import save_data
from surface.head.model.identity import Identity, save_identities
from surface.readers import NamedSurface, write_surfaces
from tests.surface.small_head import JAW, part, small_head

KNOTS = '<KnotVector degree="1">0 0 1 1</KnotVector>'
SIDE = f'<Basis type="BSplineBasis">{KNOTS}</Basis>'
BASIS = f'<Basis type="TensorBSplineBasis2">{SIDE}{SIDE}</Basis>'
XML = f'<xml>\n<Geometry type="TensorBSpline2" id="3">{BASIS}<coefs geoDim="2">0 0 1 0 0 1 1 1</coefs></Geometry></xml>'


def sheet() -> NamedSurface:
    net = [[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]]
    surface = DCPSurface.from_nurbs(1, 1, [0, 0, 1, 1], [0, 0, 1, 1], net)
    return NamedSurface("cheek", surface, Domain((0, 1, 0, 1), slits=[Slit("u", 0.5, 0.2, 0.8)]))


def test_surface_files_are_described(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(XML)
    write_surfaces(tmp_path / "b.json", [sheet(), sheet()])
    plain = "4 control points, degree 1 x 1, u 0 to 1, v 0 to 1"
    assert check_anything(str(tmp_path / "a.xml")) == [f"surface TensorBSpline2 3: {plain}: good"]
    assert check_anything(str(tmp_path / "b.json")) == [f"surface cheek: {plain}, 1 slit: good"] * 2


def test_speech_stays_speech(tmp_path: Path) -> None:
    cues = [{"start": 0.0, "end": 0.5, "value": "A"}]
    (tmp_path / "voice.json").write_text(json.dumps({"metadata": {}, "mouthCues": cues}))
    assert check_anything(str(tmp_path / "voice.json"))[0].startswith("take voice.json")
    (tmp_path / "other.json").write_text("{}")
    with pytest.raises(TakeError):
        check_anything(str(tmp_path / "other.json"))


@pytest.mark.parametrize("name", ["a.xml", "a.tsm", "a.3dm"])
def test_damaged_surfaces_are_one_error(tmp_path: Path, name: str) -> None:
    if name == "a.3dm":
        pytest.importorskip("rhino3dm", reason="reading .3dm needs rhino3dm: pip install rhino3dm")
    (tmp_path / name).write_text("<xml>\n<Geometry>")
    with pytest.raises(SurfaceFileError, match=name):
        check_anything(str(tmp_path / name))


def test_the_command_prints_it(tmp_path: Path) -> None:
    write_surfaces(tmp_path / "b.json", [sheet()])
    result = CliRunner().invoke(make_app(), ["check", str(tmp_path / "b.json")])
    assert result.exit_code == 0
    assert "surface cheek: 4 control points" in result.output


def test_files_that_use_expressions_and_parameters_of_ones_own_are_checked_with_them(tmp_path: Path) -> None:
    own, more = tmp_path / "own.toml", tmp_path / "more.toml"
    own.write_text('[parameters.earLeft]\nregion = "brows"\nprofile = "brow"\n[smirk]\nweights = { earLeft = 1 }')
    more.write_text("[both]\nof = { smirk = 0.5 }")
    script, layers = tmp_path / "script.toml", tmp_path / "script2.toml"
    script.write_text('steps = ["0 EXPR smirk", "0.5 SET earLeft 0.5", "1 NEUTRAL"]')
    with pytest.raises(ConfigError, match=r"steps\[0\][\s\S]*smirk[\s\S]*steps\[1\][\s\S]*earLeft"):
        check_anything(str(script))
    assert check_anything(str(script), [own]) == ["script script: 3 steps, 0 marks: good"]
    with pytest.raises(ConfigError, match="smirk"):
        check_anything(str(more))
    assert check_anything(str(more), [own]) == ["expressions more.toml: 1: good"]
    layers.write_text('steps = ["0 EXPR both"]')
    result = CliRunner().invoke(make_app(), ["check", str(layers), "--vocabulary", str(own), "--vocabulary", str(more)])
    assert (result.exit_code, result.output) == (0, "script script2: 1 steps, 0 marks: good\n")
    assert check_anything(str(own), [own]) == check_anything(str(own))
    controls = tmp_path / "controls.toml"
    controls.write_text('[keys]\ns = "smirk"')
    with pytest.raises(ConfigError, match="smirk"):
        check_anything(str(controls))
    assert check_anything(str(controls), [own]) == ["controls controls.toml: 1 keys: good"]


def test_every_kind_of_file_is_told_apart(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text("[smirk]\nweights = { mouthSmileLeft = 0.7 }\n[both]\nof = { smirk = 0.5 }")
    (tmp_path / "script.toml").write_text('steps = ["0 EXPR smile", "1 NEUTRAL"]\nmarks = { end = 1 }')
    with recorded(CommandState(PARAMETERS), tmp_path / "a.rec") as state:
        for i in range(50):
            state.tick(10**9 + i * 10_000_000, 0.01, PARAMETERS.neutral())
    assert check_anything(str(tmp_path / "own.toml")) == ["expressions own.toml: 2: good"]
    assert check_anything(str(tmp_path / "script.toml")) == ["script script: 2 steps, 1 marks: good"]
    assert check_anything(str(tmp_path / "a.rec"))[0].startswith("recording a.rec: 50 ticks, 0.5 s, all reproduced")
    text = (tmp_path / "a.rec").read_text().replace('["tick"', '["live",1.0,1000000000]\n["tick"', 1)
    (tmp_path / "b.rec").write_text(text)
    with pytest.raises(ControllerError, match="came out differently"):
        check_anything(str(tmp_path / "b.rec"))


def test_a_recording_without_a_tick_and_a_json_that_is_no_text(tmp_path: Path) -> None:
    with recorded(CommandState(PARAMETERS), tmp_path / "a.rec"):
        pass
    assert check_anything(str(tmp_path / "a.rec"))[0].startswith("recording a.rec: 0 ticks, 0.0 s, all reproduced")
    (tmp_path / "b.json").write_bytes(b'\xff"moves_mm"')
    with pytest.raises((TakeError, SurfaceFileError), match=r"b\.json"):
        check_anything(str(tmp_path / "b.json"))


def test_a_head_whose_vertices_leave_space_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_data(tmp_path, small_head(parts=[part("face", -40)], seams=[], paint=[]))
    pose = Head.pose

    def broken(head: Head, values: np.ndarray) -> None:
        pose(head, values)
        if values[head.parameters.index(head.parameters[1])]:
            head.parts[0].vertices[3, 1] = np.inf

    monkeypatch.setattr(Head, "pose", broken)
    with pytest.raises(ConfigError, match="= 1 throws vertices of face out of space"):
        check_anything(str(tmp_path))


def test_a_good_head_says_what_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("surface.check.check_head", lambda head: [])  # which takes seconds, and has its own tests
    (line,) = check_anything("ict")
    assert line.startswith("head ict: 13 parts, ") and line.endswith(" 59 parameters: good")


def test_a_head_says_how_far_it_is_from_its_mesh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("surface.check.check_head", lambda head: [])
    spot = "1.90 mm: shape jawOpen, chin (face, mesh to surface)"
    save_data(tmp_path, with_greatest_error(small_head(), spot))
    first, said = check_anything(str(tmp_path))
    assert first.endswith(": good") and said == f"  when it was fitted: greatest error {spot}"
    save_data(tmp_path, with_greatest_error(with_greatest_error(small_head(), spot), ""))
    assert len(check_anything(str(tmp_path))) == 1


def test_a_robot_may_be_called_as_the_file_of_a_head(tmp_path: Path) -> None:
    path = tmp_path / "head.toml"
    path.write_text((config_dir() / "robots" / "head-feetech.toml").read_text(encoding="utf-8"), encoding="utf-8")
    assert next(iter(check_anything(str(path)))).startswith("robot head-feetech: 1 buses")
    for damaged in ("name = 'me'\n", "name = \n"):
        path.write_text(damaged, encoding="utf-8")
        with pytest.raises(HeadFileError):
            list(check_anything(str(path)))


def test_every_defect_of_a_head_is_one_line_with_what_to_type(tmp_path: Path) -> None:
    head = small_head(parts=[part("face", -40), part("cheek", 10)], seams=[], paint=[])
    save_data(tmp_path, head)
    result = CliRunner().invoke(make_app(), ["check", str(tmp_path / "head.toml")])
    assert isinstance(result.exception, ConfigError)
    lines = str(result.exception).splitlines()
    assert len(lines) >= 2 and all(line.startswith(f"{tmp_path}: ") and "; next: " in line for line in lines)
    assert any("missing eye: no part follows left_eye" in line for line in lines)
    assert any(f"omote fit MESH -o {tmp_path}" in line for line in lines)


def test_what_a_head_lacks_is_a_warning(tmp_path: Path) -> None:
    patch = part("face", -150.0, jaw=np.zeros(25))
    wide = replace(patch, points=patch.points * [3.0, 3.0, 1.0] + [390.0, 0.0, 20.0])
    save_data(tmp_path, small_head(parts=[wide], seams=[], paint=[], eye_radius=0.0, jaw=replace(JAW, angle_rad=0.0)))
    good, warning = check_anything(str(tmp_path))
    assert good.endswith(": good") and warning.startswith("  warning: missing eye: the head has no eyes")


def test_calibrations_and_expressions_that_are_shipped_are_told_apart(tmp_path: Path) -> None:
    path = tmp_path / "c.calibration.toml"
    save_calibration(path, "desk", "head24", {"jawOpen": CapturedAngles(min_deg=0, neutral_deg=1, max_deg=9)})
    assert check_anything(str(path)) == ["calibration desk of robot head24: 1 channels: good"]
    shipped = config_dir() / "vocabularies" / "expressions.toml"
    names = len(Vocabulary.load(PARAMETERS).names)
    assert check_anything(str(shipped)) == [f"expressions expressions.toml: {names}: good"]
    (tmp_path / "stage.toml").write_text("name = 3")
    with pytest.raises(ConfigError, match="name: "):
        check_anything(str(tmp_path / "stage.toml"))


def test_what_a_stage_has_and_has_not(tmp_path: Path) -> None:
    assert check_anything("demo") == ["stage demo: head ict, links: line on simulated, robots: head24: good"]
    (tmp_path / "bare.toml").write_text('name = "bare"\n')
    assert check_anything(str(tmp_path / "bare.toml")) == ["stage bare: head ict, links: none, robots: none: good"]


SHIPPED = {
    "vocabularies/arkit.toml": "parameters arkit.toml: 59",
    "vocabularies/facs.toml": "action units facs.toml: 61 with sides, 8 emotions",
    "vocabularies/affect.toml": "moods affect.toml: 9 anchors",
    "vocabularies/visemes.toml": "visemes visemes.toml: 15, 61 phonemes",
    "vocabularies/vrm.toml": "presets vrm.toml: 18",
    "vocabularies/layers.toml": "layers layers.toml: expression, idle, gaze, speech, capture, manual",
    "life/natural.toml": "life natural.toml: a blink every 4.5 s on average, 13 gestures",
}


@pytest.mark.parametrize("name", SHIPPED)
def test_every_file_of_settings_is_checked_as_what_it_is(name: str) -> None:
    assert check_anything(str(config_dir() / name)) == [f"{SHIPPED[name]}: good"]


@pytest.mark.parametrize(
    ("name", "good", "wrong", "told"),
    [
        ("vocabularies/facs.toml", "browInnerUp", "browInnerUpp", "unknown parameter"),
        ("vocabularies/affect.toml", "anchors.", "anchor.", "anchor: unknown key, did you mean 'anchors'"),
        ("vocabularies/visemes.toml", "duration =", "durasion =", "durasion: unknown key, did you mean 'duration'"),
        ("vocabularies/layers.toml", "priority = 10", "priority = 'x'", "priority: input should be a valid integer"),
        (
            "vocabularies/arkit.toml",
            'region = "jaw"',
            'region = "jam"',
            "region: unknown region 'jam'",
        ),
        ("life/natural.toml", "[breath]", "[breathe]", "breathe: unknown key, did you mean 'breath'"),
    ],
)
def test_faults_are_those_of_the_kind(tmp_path: Path, name: str, good: str, wrong: str, told: str) -> None:
    text = (config_dir() / name).read_text(encoding="utf-8")
    assert good in text
    path = tmp_path / Path(name).name
    path.write_text(text.replace(good, wrong, 1), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        check_anything(str(path))
    assert told in str(caught.value)


def test_a_layer_that_is_no_table_is_a_fault_of_its_file(tmp_path: Path) -> None:
    path = tmp_path / "layers.toml"
    path.write_text((config_dir() / "vocabularies" / "layers.toml").read_text() + "\n[more]\npriority = 99\n")
    path.write_text("gaze_2 = 3\n" + path.read_text())
    with pytest.raises(ConfigError, match=r"layers\.gaze_2: must be a table"):
        check_anything(str(path))


def test_a_mesh_is_refused_with_how_it_becomes_a_head_that_can_be_checked(tmp_path: Path) -> None:
    """A .glb was said to be larger than 1 MB."""
    mesh = tmp_path / "me.glb"
    mesh.write_bytes(b"glTF" + bytes(2_000_000))
    with pytest.raises(ConfigError, match="is a mesh") as told:
        check_anything(str(mesh))
    assert told.value.hint == f"omote fit {mesh} -o HEAD; omote check HEAD"


def test_a_file_of_no_kind_says_so(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("colour = 3\nshape = 4\n")
    with pytest.raises(ConfigError, match="no kind of file has the keys colour, shape"):
        check_anything(str(tmp_path / "a.toml"))


def test_names_of_vocabularies_scripts_and_life_are_found() -> None:
    assert check_anything("facs")[0].startswith("action units") and check_anything("natural")[0].startswith("life")


def test_what_a_file_says_is_printed_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text('name = "[/bold] [red]"\nsteps = []')
    result = CliRunner().invoke(make_app(), ["check", str(tmp_path / "s.toml")])
    assert result.exit_code == 0 and "script [/bold] [red]: 0 steps" in result.output


def test_identities_that_do_not_fit_the_head_are_found(tmp_path: Path) -> None:
    save_data(tmp_path / "small", small_head())
    stranger = Identity("wide", {}, {}, np.zeros((2, 3)), np.zeros(3), 5)
    save_identities(tmp_path / "small", [stranger])
    with pytest.raises(HeadFileError, match="another fit"):
        check_anything(str(tmp_path / "small"))


def test_a_bad_object_of_a_surface_file_is_left_out_by_name(tmp_path: Path) -> None:
    rhino: Any = pytest.importorskip("rhino3dm", reason="writing .3dm files needs rhino3dm: pip install rhino3dm")
    file = rhino.File3dm()
    for weight in (1.0, -1.0):
        form = rhino.NurbsSurface.Create(3, True, 2, 2, 2, 2)
        form.KnotsU.CreateUniformKnots(1.0)
        form.KnotsV.CreateUniformKnots(1.0)
        for i in range(2):
            for j in range(2):
                form.Points[(i, j)] = rhino.Point4d(i * weight, j * weight, 0.0, weight)
        file.Objects.Add(form, rhino.ObjectAttributes())
    assert file.Write(str(tmp_path / "a.3dm"), 7)
    good, bad = check_anything(str(tmp_path / "a.3dm"))
    assert good.startswith("surface object 0: 4 control points")
    assert good.endswith(": good")
    assert bad.startswith("  left out: ")
    assert "object 1 (" in bad
