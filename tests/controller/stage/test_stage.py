"""Stages: what is shipped is whole; every fault of a stage and of what it names is told at once."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from pathlib import Path

import pytest

from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import PARAMETERS
from controller.stage.stage import Stage, check_identity, load_stage, parse_identity, with_picture


def stage_file(tmp_path: Path, text: str) -> str:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return str(path)


@pytest.mark.parametrize("name", ["demo", "everything", "gamepad", "play", "serial", "voice-and-phone", "websocket"])
def test_shipped_stages_are_whole(name: str) -> None:
    stage = load_stage(name, PARAMETERS)
    assert stage.settings.name == name
    assert (stage.head / "head.toml").is_file()
    assert len(stage.robots) == len(stage.settings.robots)


def test_an_unknown_stage_names_the_closest() -> None:
    with pytest.raises(ConfigError, match="did you mean 'demo'"):
        load_stage("dmeo", PARAMETERS)


def test_faults_of_stage_and_references_come_together(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text('name = "r"\nbuses = []\nchannels = []\nspeed = 1')
    text = 'name = "mine"\nhead = "nobody"\nrobots = ["robot.toml", "head42"]'
    with pytest.raises(ConfigError) as caught:
        load_stage(stage_file(tmp_path, text), PARAMETERS)
    message = str(caught.value)
    assert "3 faults" in message
    assert "head: no head 'nobody'" in message
    assert "robots[0]:" in message
    assert "speed: unknown key" in message
    assert "robots[1]: no robot 'head42', did you mean 'head24'?" in message


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("[face]\nsize = [0, 720]", "face.size[0]: "),
        ("[face]\nqualty = 'full'", "face.qualty: unknown key, did you mean 'quality'?"),
        (
            '[[links]]\nkind = "vmc"\nlisten = "127.0.0.1:5"\ngains = { brow = 0.5 }',
            "links[0].gains: no region called 'brow', did you mean 'brows'",
        ),
        ("[[links]]\nbaud = 9600", "links[0]: give port, as"),
        ("[[links]]\nport = '/dev/x'\nscript = 'tour'", 'links[0]: script needs port = "simulated"'),
        ("control_hz = 0", "control_hz: "),
    ],
)
def test_a_fault_is_named_with_its_key(tmp_path: Path, text: str, fault: str) -> None:
    top, _, tables = text.partition("[") if text.startswith("[") else (text, "", "")
    body = f'name = "mine"\n{top}\n' + (f"[{tables}" if tables else "")
    with pytest.raises(ConfigError) as caught:
        load_stage(stage_file(tmp_path, body), PARAMETERS)
    assert fault in str(caught.value)


def test_a_stage_has_layers_expressions_and_shows_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text("[smirk]\nweights = { mouthSmileLeft = 0.7 }")
    text = 'name = "mine"\nvocabularies = ["own.toml"]\nshow = "tour"\nseed = 3\ncontrol_hz = 200\n'
    text += "[layers.capture]\ngains = { brows = 0.5 }\n[layers.late]\npriority = 70\n"
    stage = load_stage(stage_file(tmp_path, text), PARAMETERS)
    state = stage.state(PARAMETERS)
    assert state.vocabulary["smirk"].weights[PARAMETERS.index("mouthSmileLeft")] == 0.7
    assert state.layer_names()[-1] == "late"
    assert state.mixer["capture"].gain[PARAMETERS.index("browInnerUp")] == 0.5
    assert stage.period_s == 0.005


def test_faults_of_its_own_files_are_told_with_the_rest(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text("[a]\nof = { b = 1 }\n[b]\nof = { a = 1 }")
    text = 'name = "mine"\nvocabularies = ["own.toml", "none.toml"]\nshow = "tuor"\nlife = "natral"\nhead = "nobody"\n'
    with pytest.raises(ConfigError) as caught:
        load_stage(stage_file(tmp_path, text + "[layers.capture]\ngain = 1\n"), PARAMETERS)
    message = str(caught.value)
    for part in (
        "6 faults",
        "vocabularies[1]: no vocabulary 'none.toml'",
        "goes in a circle: a -> b -> a",
        "show: no script 'tuor', did you mean 'tour'?",
        "life: no life 'natral', did you mean 'natural'?",
        "layers.capture.gain: unknown key, did you mean 'gains'?",
        "head: no head 'nobody'",
    ):
        assert part in message


def test_options_lie_over_the_stage() -> None:
    stage = load_stage("everything", PARAMETERS)
    other = with_picture(stage, {"kiosk": True, "quality": "fast", "theme": None})
    face = other.settings.face
    assert (face.kiosk, face.quality, face.theme) == (True, "fast", "skin")
    assert (face.size, face.fps) == (stage.settings.face.size, stage.settings.face.fps)
    assert stage.settings.face.quality == "full"


def test_identities_are_names_and_amounts():
    assert parse_identity("broad=0.6, young") == {"broad": 0.6, "young": 1.0}
    assert parse_identity(None) == {}
    for wrong in ("broad=2", "broad=-0.1", "broad=x", "=1", "broad=nan"):
        with pytest.raises(ParameterError, match="--identity"):
            parse_identity(wrong)


def test_identities_are_those_of_the_head() -> None:
    head = load_stage("demo", PARAMETERS).head
    check_identity(head, {})
    check_identity(head, {"broad": 0.5})
    with pytest.raises(ConfigError, match=r"no identity 'brod'; there are .*broad") as caught:
        check_identity(head, {"broad": 1.0, "brod": 1.0})
    assert "omote fit --help" in caught.value.hint


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(Stage).anything = 1


def test_a_stage_that_says_nothing_has_the_usual_settings_and_the_name_of_its_file(tmp_path: Path) -> None:
    settings = load_stage(stage_file(tmp_path, ""), PARAMETERS).settings
    found = settings.model_dump()
    face = found.pop("face")
    assert found == {
        "name": "mine", "description": "", "head": "ict", "identity": {}, "robots": [],
        "control_hz": 100.0, "liveliness": 0.0, "life": "natural", "manner": "auto", "seed": 0, "vocabularies": [],
        "show": None, "take": None, "voice": None, "voice_hz": None, "groups": {}, "layers": {}, "links": [],
        "heads": [], "turns": "manual", "zenoh": None,
    }  # fmt: skip
    assert (face["size"], face["fps"]) == ((1280, 720), 60.0)


@pytest.mark.parametrize(
    ("line", "ends", "beyond"),
    [
        ("control_hz = {}", (10, 1000), (9.99, 1000.1)),
        ("liveliness = {}", (0, 1), (-0.01, 1.01)),
        ("seed = {}", (0, 10**9), (-1,)),
        ("voice_hz = {}", (1000, 48_000), (999,)),
        ("identity = {{ broad = {} }}", (0, 1), (-0.01, 1.01)),
        ("[face]\nfps = {}", (1, 1000), (0.9, 1000.1)),
        ("[face]\nsize = [{}, 100]", (16, 16384), (15, 16385)),
    ],
)
def test_settings_of_a_stage_have_limits(
    tmp_path: Path, line: str, ends: tuple[float, ...], beyond: tuple[float, ...]
) -> None:
    for value in ends:
        load_stage(stage_file(tmp_path, f'name = "mine"\n{line.format(value)}'), PARAMETERS)
    for value in beyond:
        with pytest.raises(ConfigError, match="1 fault"):
            load_stage(stage_file(tmp_path, f'name = "mine"\n{line.format(value)}'), PARAMETERS)


def test_two_links_do_not_write_one_layer_and_a_layer_must_be_there(tmp_path: Path) -> None:
    link = '[[links]]\nkind = "{}"\nlisten = "127.0.0.1"\n'
    text = 'name = "mine"\n' + link.format("livelink") + link.format("vmc")
    with pytest.raises(ConfigError, match=r"links\[1\].layer: links\[0\] writes capture already"):
        load_stage(stage_file(tmp_path, text), PARAMETERS)
    unknown = r"links\[1\].layer: unknown layer 'secnd', did you mean 'second'.*\[layers.secnd\] with priority = 55"
    with pytest.raises(ConfigError, match=unknown):
        load_stage(stage_file(tmp_path, text + 'layer = "secnd"\n[layers.second]\npriority = 55\n'), PARAMETERS)
    stage = load_stage(stage_file(tmp_path, text + 'layer = "second"\n[layers.second]\npriority = 55\n'), PARAMETERS)
    assert [str(each) for each in stage.settings.links] == [
        "livelink on udp:127.0.0.1:11111",
        "vmc on udp:127.0.0.1:39539",
    ]
    sends = text.replace('kind = "vmc"\nlisten', 'kind = "vmc"\nsend')
    assert load_stage(stage_file(tmp_path, sends), PARAMETERS)
