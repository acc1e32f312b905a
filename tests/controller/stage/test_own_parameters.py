"""Parameters of one's own go the whole way: vocabulary, stage, layers, servos, formats, takes, recordings, panels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError, ControllerError, ParameterError, TakeError
from controller.base.mailboxes import Mailbox
from controller.base.parameters import PARAMETERS, Parameters
from controller.body.panel_state import PanelState
from controller.formats.format import FORMATS
from controller.formats.frame import Frame
from controller.links.line.protocol import parse_reply
from controller.links.line.session import LineSession
from controller.links.websocket.conversation import _parameter
from controller.robot.channels import build_table
from controller.robot.following import Mirror
from controller.robot.settings import RobotSettings
from controller.stage import stage as stages
from controller.stage.stage import Stage, load_stage
from controller.takes.reader import load_take
from controller.takes.recording import recorded, replay
from controller.tools.check import check_anything
from controller.tools.motion_file import convert, load_motion
from controller.vocabulary.vocabulary import Vocabulary
from tests.controller.robot.small_robot import robot_text

SECOND = 10**9
EARS = """
regions = ["ears"]

[profile.ear]
region = "ears"
range = [-1.0, 1.0]
max_speed = 6.0
max_acceleration = 80.0
response_s = 0.02

[parameters.earLeft]
profile = "ear"
rest = 0.25
description = "how far the left ear stands up"

[parameters.earRight]
profile = "ear"

[parameters.noseGlow]
profile = "mouth"
region = "nose"

[aliases]
redNose = "noseGlow"

[alert]
weights = { ear = 0.75, browInnerUp = 0.5 }
"""
ROBOT = (
    robot_text("ears")
    + """
[[channels]]
name = "left"
id = 1
profile = "servo"
mix = { earLeft = 1 }

[[channels]]
name = "right"
id = 2
profile = "servo"
mix = { earRight = 1 }
"""
)


@pytest.fixture
def files(tmp_path: Path) -> Path:
    (tmp_path / "ears.toml").write_text(EARS)
    (tmp_path / "robot.toml").write_text(ROBOT)
    (tmp_path / "stage.toml").write_text(
        'name = "mine"\nvocabularies = ["ears.toml"]\nrobots = ["robot.toml"]\n'
        "[layers.manual]\ngains = { ears = 0.5 }\n"
    )
    return tmp_path


@pytest.fixture
def stage(files: Path) -> Stage:
    return load_stage(str(files / "stage.toml"), PARAMETERS)


@pytest.fixture
def own(files: Path) -> Parameters:
    return PARAMETERS.with_files([files / "ears.toml"])


def test_they_stand_behind_the_base_vocabulary_and_know_their_own_names(own: Parameters) -> None:
    assert own.names == (*PARAMETERS.names, "earLeft", "earRight", "noseGlow")
    assert own.own == ("earLeft", "earRight", "noseGlow")
    assert own.index("ear_L") == own.index("earLeft") == len(PARAMETERS)
    assert own.index("REDNOSE") == own.index("noseGlow")
    assert own.region("ears").tolist() == [59, 60]
    assert own.neutral()[59] == 0.25
    assert own.mirror()[59] == 60
    assert own.max_jerk[61] == PARAMETERS.max_jerk[PARAMETERS.index("mouthPucker")]  # the shipped profile "mouth"
    assert own.with_files(own.files) is own
    with pytest.raises(ParameterError, match="unknown parameter 'earLft', did you mean 'earLeft'"):
        own.index("earLft")


def test_without_any_everything_is_as_before(root: Path) -> None:
    assert PARAMETERS.with_files([root / "configs/vocabularies/expressions.toml"]) is PARAMETERS
    assert PARAMETERS.own == ()
    assert load_stage("demo", PARAMETERS).parameters is PARAMETERS


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("[parameters.earRight]", "[parameters.jawOpen]", "parameters.jawOpen: is a name of jawOpen already"),
        ("[parameters.earRight]", "[parameters.Ear_Left]", "is the same name as parameters.earLeft"),
        ("[parameters.earRight]", '[parameters."ear right"]', "must be a letter, then letters"),
        ("[parameters.earRight]", "[parameters.time]", "is a word of links and formats"),
        ('regions = ["ears"]', "", "parameters.earLeft.region: unknown region 'ears'"),
        ("rest = 0.25", "rest = 1.25", "parameters.earLeft.rest: must lie in the range, -1 to 1"),
        ('redNose = "noseGlow"', 'smile = "noseGlo"', "unknown parameter 'noseGlo', did you mean 'noseGlow'"),
        ("max_speed = 6.0", "max_sped = 6.0", "parameters.earLeft.max_sped: unknown key, did you mean 'max_speed'"),
    ],
)
def test_a_wrong_vocabulary_says_what_is_wrong(files: Path, old: str, new: str, fault: str) -> None:
    (files / "ears.toml").write_text(EARS.replace(old, new))
    with pytest.raises(ConfigError) as caught:
        load_stage(str(files / "stage.toml"), PARAMETERS)
    assert fault in str(caught.value)


def test_a_robot_names_its_own_vocabulary_without_a_stage(files: Path) -> None:
    robot = files / "robot.toml"
    with pytest.raises(ConfigError, match=r"channels\[0\].mix.earLeft: unknown parameter 'earLeft'"):
        check_anything(str(robot))
    robot.write_text('vocabularies = ["ears.toml"]\n' + ROBOT)
    assert check_anything(str(robot)) == ["robot ears: 1 buses, 2 channels: good"]
    (files / "stage.toml").write_text('name = "mine"\nrobots = ["robot.toml"]\n')
    assert load_stage(str(files / "stage.toml"), PARAMETERS).parameters.own == ("earLeft", "earRight", "noseGlow")


def test_check_lists_them(files: Path) -> None:
    assert check_anything(str(files / "ears.toml")) == [
        "expressions ears.toml: 1, parameters of its own: earLeft, earRight, noseGlow: good"
    ]
    assert "parameters of its own: earLeft" in check_anything(str(files / "stage.toml"))[0]


def test_layers_expressions_limits_and_servos(stage: Stage) -> None:
    p, state = stage.parameters, stage.state()
    left, right, values = p.index("earLeft"), p.index("earRight"), p.neutral()
    state.tick(SECOND, 0.01, values)
    assert values[left] == 0.25
    state.expression("alert", 1.0, None, SECOND)
    state.set_parameters([right], [-0.5], SECOND)
    speeds = []
    for i in range(300):
        before = values.copy()
        state.tick(SECOND + i * SECOND // 100, 0.01, values)
        speeds.append(np.abs(values - before)[[left, right]] * 100)
    assert values[[left, right]] == pytest.approx([0.75, -0.25], abs=1e-3)  # the gain of the region halves -0.5
    assert np.max(speeds) <= 6.0 + 1e-9
    assert state.holder(right) == "manual"
    table = build_table(stage.robots[0].channels, p)
    assert np.degrees(table.neutral_rad) == pytest.approx([10.0, 0.0])
    angles, _ = table.angles(values)
    assert np.degrees(angles) == pytest.approx([30.0, -10.0], abs=0.05)
    assert Mirror(table, p).read(angles)[[left, right]] == pytest.approx([0.75, -0.25], abs=5e-3)


def test_half_an_expression_is_half_way_from_rest(stage: Stage) -> None:
    shown = stage.vocabulary.expand("alert", 0.5)
    assert shown[stage.parameters.index("earLeft")] == pytest.approx(0.5)
    assert shown[stage.parameters.index("earRight")] == pytest.approx(0.375)


@pytest.mark.parametrize(("kind", "carried"), [
    ("csv", True), ("json", True), ("osc", True), ("omote-line", True),
    ("binary", False), ("vmc", False), ("livelink", False), ("ifacialmocap", False), ("facemotion3d", False),
])  # fmt: skip
def test_formats_with_names_carry_them_and_the_others_leave_them_out(own: Parameters, kind: str, carried: bool) -> None:
    form = FORMATS.get(kind)
    assert form.carries(own)[own.base :].all() == carried
    values = own.neutral()
    values[own.index("earLeft")], values[own.index("jawOpen")] = -0.5, 0.5
    messages = form.encoder(own).encode(Frame(values, np.ones(len(own), dtype=bool)))
    decoder = form.decoder(own)
    found = [frame for message in messages for frame in decoder.feed(message)]
    assert found[-1].values[own.index("jawOpen")] == pytest.approx(0.5, abs=0.01)
    assert found[-1].mask[own.index("earLeft")] == carried
    assert found[-1].values.shape == (len(own),)
    if carried:
        assert found[-1].values[own.index("earLeft")] == pytest.approx(-0.5)


def test_a_binary_frame_stays_139_bytes(own: Parameters) -> None:
    lengths = {len(FORMATS.get("binary").encoder(p).encode(Frame(p.neutral(), np.ones(len(p), dtype=bool)))[0])
               for p in (PARAMETERS, own)}  # fmt: skip
    assert len(lengths) == 1


def test_the_line_protocol(stage: Stage) -> None:
    state, values = stage.state(), stage.parameters.neutral()
    session = LineSession(state, SECOND)

    def say(line: str) -> str:
        reply = parse_reply(session.feed(line.encode() + b"\n", SECOND).splitlines()[0])
        assert reply is not None
        return reply.text

    assert "parameters=62" in say("HELLO")
    assert say("LIST PARAMETERS").split()[-3:] == ["earLeft", "earRight", "noseGlow"]
    assert say("SET earRight -1 noseGlow 0.5") == "SET 2"
    assert "low=-1 high=1 rest=0.25 region=ears" in say("INFO earLeft")
    assert "did you mean 'earLeft'" in say("SET earLft 0.5")
    state.tick(2 * SECOND, 0.01, values)
    assert len(say("GET ALL").split()) == 2 + 62
    assert say("FRAME " + " ".join(["0"] * 62)) == "SET 62"


def test_a_recording_needs_the_same_ones(stage: Stage, tmp_path: Path) -> None:
    path, values = tmp_path / "a.rec", stage.parameters.neutral()
    with recorded(stage.state(), path) as state:
        state.set_parameters([stage.parameters.index("earRight")], [0.5], SECOND)
        for i in range(20):
            state.tick(SECOND * (1 + i), 0.05, values)
    last = [row.copy() for _, row in replay(path, stage.parameters, make=stage.state)][-1]
    assert np.array_equal(last, values)
    with pytest.raises(ControllerError, match="other parameters"):
        list(replay(path, PARAMETERS))


@pytest.mark.parametrize("suffix", [".csv", ".mcap"])
def test_takes_carry_them(own: Parameters, tmp_path: Path, suffix: str) -> None:
    if suffix == ".mcap":
        pytest.importorskip("mcap")
    (tmp_path / "a.csv").write_text("time,earLeft,jawOpen\n0,-0.5,0\n0.5,0.75,1\n")
    path = tmp_path / f"b{suffix}"
    convert(tmp_path / "a.csv", path, own)
    motion = load_motion(path, own)
    assert motion.values[:, own.index("earLeft")].tolist() == [-0.5, 0.75]
    with pytest.raises(TakeError, match="unknown column 'earLeft'"):
        load_take(tmp_path / "a.csv", PARAMETERS)


@pytest.mark.parametrize("kind", ["csv", "json"])
def test_streams_that_were_saved_carry_them(own: Parameters, tmp_path: Path, kind: str) -> None:
    encoder, values = FORMATS.get(kind).encoder(own), own.neutral()
    values[own.index("earLeft")], path = -0.5, tmp_path / f"a.{kind}"
    frames = [Frame(values, np.ones(len(own), dtype=bool), n / 10) for n in range(3)]
    path.write_bytes(b"\n".join(each for frame in frames for each in encoder.encode(frame)))
    take = load_take(path, own)
    assert take.values[:, own.index("earLeft")].tolist() == [-0.5] * 3 and take.mask.all()


def test_panels_show_them(stage: Stage) -> None:
    told = _parameter(stage.parameters, stage.parameters.index("earLeft"))
    assert (told.region, told.rest, told.description) == ("ears", 0.25, "how far the left ear stands up")
    with Mailbox.create(PanelState.size(stage.parameters)) as mailbox:
        panel = PanelState(mailbox, ["manual"], stage.parameters)
        panel.publish(stage.state(), None)
        panel.refresh()
        assert panel.away_deg("ears") is None


def test_sliders_of_the_window_have_their_region(stage: Stage) -> None:
    pytest.importorskip("imgui_bundle")
    from controller.panels.session.commands import Commands
    from controller.panels.window.sliders import Sliders

    sliders = Sliders(stage.parameters.neutral, Commands(lambda _: None), None, stage.parameters)
    assert sliders.rows("ears") == [(59, 60)]


def test_a_vocabulary_of_a_stage_without_them_cannot_name_them(files: Path) -> None:
    with pytest.raises(ConfigError, match=r"alert\.weights\.ear: unknown parameter"):
        Vocabulary.load(PARAMETERS, more=[files / "ears.toml"])


def test_all_heads_of_a_stage_have_the_parameters_of_each_ones_robots(files: Path) -> None:
    (files / "eared.toml").write_text('vocabularies = ["ears.toml"]\n' + ROBOT)
    heads = '[[heads]]\nname = "maple"\n[[heads]]\nname = "oak"\nrobots = ["eared.toml"]\n'
    (files / "hall.toml").write_text('name = "hall"\n' + heads)
    stage = load_stage(str(files / "hall.toml"), PARAMETERS)
    assert [head.stage.parameters.own for head in stage.heads] == [("earLeft", "earRight", "noseGlow")] * 2
    assert stage.parameters.names == stage.heads[1].stage.parameters.names  # one mailbox's width serves every head


def test_what_many_heads_name_is_read_once_and_its_fault_is_that_of_each(
    files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stage of 200 heads took half a minute."""
    (files / "eared.toml").write_text('vocabularies = ["ears.toml"]\n' + ROBOT)
    (files / "wrong.toml").write_text('name = "wrong"\n')
    heads = "".join(f'[[heads]]\nname = "h{k}"\nrobots = ["eared.toml"]\n' for k in range(200))
    (files / "hall.toml").write_text(heads)
    read, load = list[Path](), stages.load_robot

    def counted(path: Path, parameters: Parameters) -> RobotSettings:
        read.append(path)
        return load(path, parameters)

    monkeypatch.setattr(stages, "load_robot", counted)
    assert len(load_stage(str(files / "hall.toml"), PARAMETERS).heads) == 200
    assert len(read) == 2  # before the parameters of its own are known, and with them
    (files / "hall.toml").write_text(heads.replace("eared.toml", "wrong.toml"))
    with pytest.raises(ConfigError) as caught:
        load_stage(str(files / "hall.toml"), PARAMETERS)
    assert "heads[0].robots[0]: " in str(caught.value) and "heads[7].robots[0]: " in str(caught.value)


@pytest.mark.parametrize("value", ["1e12", "[1]", '"x"', "true"])
def test_parameters_that_are_no_table_are_a_fault_of_the_file(files: Path, value: str) -> None:
    text = (files / "ears.toml").read_text()
    (files / "odd.toml").write_text(f"parameters = {value}\n" + text[text.index("[profile") : text.index("[param")])
    with pytest.raises(ConfigError, match="parameters: must be a table"):
        check_anything(str(files / "odd.toml"))
