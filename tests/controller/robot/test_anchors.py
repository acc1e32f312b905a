"""Anchors: where servos pull at the skin, solved against the head's own skin."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.base.paths import find_config
from controller.robot.anchors import (
    AnchorSolver,
    PullRows,
    SkinSamples,
    load_anchors,
    pull_range_mm,
    residual_rows,
    sample_skin,
    servo_field,
)
from controller.robot.channels import build_table
from controller.robot.following import Mirror
from controller.robot.robot import load_robot
from controller.robot.settings import RobotSettings
from controller.robot.suggest_servos import suggest_servos
from controller.tools.check import check_anything
from controller.vocabulary.vocabulary import Vocabulary
from surface.head import Head

ROBOT = """
name = "r"
buses = [{ name = "b", kind = "simulated" }]
landmarks = { corner = [28.6, -34, 102] }
[[channels]]
name = "corner"
bus = "b"
id = 1
model = "xl330-m288"
anchor = { point = "corner", direction = [0, 1, 0] }
map = { at = [-5, 0, 10], deg = [-20, 0, 40] }
limit_deg = [-25, 45]
max_speed_deg_s = 300
max_accel_deg_s2 = 3000
"""


@pytest.fixture(scope="module")
def head() -> Head:
    return Head.load(find_config("heads", "ict"))


@pytest.fixture(scope="module")
def robot() -> RobotSettings:
    return load_robot(find_config("robots", "head24-anchors"), P)


@pytest.fixture(scope="module")
def solved(head: Head, robot: RobotSettings) -> AnchorSolver:
    found = load_anchors(robot, head, P)
    assert found is not None
    return found


def face(**values: float) -> np.ndarray:
    out = P.neutral()
    for name, value in values.items():
        out[P.index(name)] = value
    return out


def written(tmp_path: Path, text: str) -> RobotSettings:
    (tmp_path / "robot.toml").write_text(text)
    return load_robot(tmp_path / "robot.toml", P)


@pytest.mark.slow
@pytest.mark.parametrize(
    "values",
    [
        {"jawOpen": 0.6},
        {"eyeBlinkLeft": 0.5},
        {"mouthSmileLeft": 0.7, "browInnerUp": 0.4},
        {"jawOpen": 0.8, "mouthClose": 0.8},
        {"eyeWideLeft": 1.0, "eyeBlinkLeft": 1.0},
        {"leftEyePitch": 0.5},
    ],
)
def test_the_sampled_skin_goes_where_the_head_goes(head: Head, solved: AnchorSolver, values: dict[str, float]) -> None:
    skin = solved.skin
    part = head.part(skin.part)
    head.pose(head.values(values))
    true = part.surface.basis_matrix(skin.uv) @ part.control_points - skin.rest
    head.pose(np.zeros(len(head.parameters)))
    away = np.linalg.norm(skin.displacement(solved.shape_values(face(**values))) - true, axis=1)
    assert away.max() < 1.0  # mm; arcs and lids meet between the samples


@pytest.mark.slow
def test_anchors_lie_where_their_landmarks_say(robot: RobotSettings, solved: AnchorSolver) -> None:
    wanted = [
        robot.landmarks[c.anchor.point] for c in robot.anchored_channels if c.anchor and isinstance(c.anchor.point, str)
    ]
    own = solved.skin.rest[: len(wanted)]
    assert np.linalg.norm(own - wanted, axis=1).max() < 2.0  # mm
    left, right = (own[[n.endswith(side) for n in solved.names]] for side in ("Left", "Right"))
    assert np.abs(left * [-1, 1, 1] - right).max() < 1.0


def test_one_anchor_is_pulled_as_far_as_the_skin_goes(tmp_path: Path, head: Head) -> None:
    robot = written(tmp_path, ROBOT.replace("[0, 1, 0] }", "[0, 1, 0], reach_mm = 90 }"))
    one = load_anchors(robot, head, P)
    assert one is not None
    for amount in (0.3, 0.8):
        moved = one.skin.displacement(one.shape_values(face(mouthSmileLeft=amount)))[:, 1]
        near = np.linalg.norm(one.skin.rest - one.skin.rest[0], axis=1) < 8.0
        mean = moved[near].mean()  # the field falls off with distance and across the mouth, so it takes a little more
        assert mean < one.pulls_mm(face(mouthSmileLeft=amount))[0] < 1.35 * mean
    assert one.pulls_mm(face(mouthFrownLeft=1.0))[0] < -3.0
    assert one.pulls_mm(face(mouthSmileLeft=1.0, mouthUpperUpLeft=1.0, noseSneerLeft=1.0))[0] == pytest.approx(10.0)
    angle = build_table(robot.channels, P, one).angles(face(mouthSmileLeft=0.8))[0]
    assert np.degrees(angle[0]) == pytest.approx(4.0 * one.pulls_mm(face(mouthSmileLeft=0.8))[0])


@pytest.mark.slow
def test_unseen_skin_follows_better_than_one_parameter_for_one_servo(
    head: Head, robot: RobotSettings, solved: AnchorSolver
) -> None:
    channels = robot.anchored_channels
    anchors = [channel.anchor for channel in channels if channel.anchor is not None]
    k = len(anchors)
    used = {tuple(point) for point in solved.skin.uv}
    fresh = [point for point in head.part("face").mesh.uv.astype(float) if tuple(point) not in used]
    unseen = sample_skin(head, "face", np.concatenate([solved.skin.uv[:k], fresh]))
    own = unseen.subset(slice(k))
    field, rows = servo_field(anchors, own, unseen).reshape(-1, 3, k), PullRows.near(anchors, own, unseen, 6.0)
    main = ["jawOpen", "jawLeft", *(f"{n}{s}" for n in ("eyeBlink", "eyeSquint") for s in ("Left", "Right"))]
    main += ["browInnerUp", "browInnerUp", "browOuterUpLeft", "browOuterUpRight"]
    main += [f"{n}{s}" for n in ("mouthSmile", "mouthStretch") for s in ("Left", "Right")]
    main += ["mouthUpperUpLeft", "mouthLowerDownLeft", "noseSneerLeft"]
    vocabulary, left = Vocabulary.load(P), {"naive": 0.0, "solved": 0.0}
    for name in ("happiness", "sadness", "surprise", "fear", "anger", "disgust", "contempt"):
        values = vocabulary[name].weights
        wanted = unseen.displacement(solved.shape_values(values))
        naive = np.array([values[P.index(n)] * c.map.at[-1] for n, c in zip(main, channels, strict=True)])
        for key, pulls in (("naive", naive), ("solved", solved.pulls_mm(values))):
            left[key] += float((rows.project(wanted - field @ pulls) ** 2).sum())
    assert left["solved"] < (1 / 3) ** 2 * left["naive"]  # sums of squares: less than a third of the rms


def test_pulls_stay_within_travel_whatever_is_asked(robot: RobotSettings, solved: AnchorSolver) -> None:
    rng = np.random.default_rng(0)
    low, high = np.array([(c.map.at[0], c.map.at[-1]) for c in robot.anchored_channels]).T
    for _ in range(100):
        pulls = solved.pulls_mm(rng.uniform(P.low, P.high))
        assert np.all(pulls >= low - 1e-9) and np.all(pulls <= high + 1e-9)
    assert np.abs(solved.pulls_mm(P.neutral())).max() < 1e-6


def test_a_bus_gets_the_pulls_of_its_own_channels(robot: RobotSettings, solved: AnchorSolver) -> None:
    part = solved.for_channels(["lowerLip", "jawOpen", "neckYaw"])
    assert part is not None
    assert part.names == ("jawOpen", "lowerLip")
    values = face(jawOpen=0.5, mouthLowerDownLeft=0.5)
    both = dict(zip(solved.names, solved.pulls_mm(values), strict=True))
    assert part.pulls_mm(values) == pytest.approx([both["jawOpen"], both["lowerLip"]], abs=1e-3)
    assert solved.for_channels(["neckYaw"]) is None


def test_the_mirror_reads_a_head_of_anchors(robot: RobotSettings, solved: AnchorSolver) -> None:
    table = build_table(robot.channels, P, solved)
    read = Mirror(table, P).read(table.angles(face(jawOpen=0.6))[0])
    assert read[P.index("jawOpen")] == pytest.approx(0.6, abs=0.2)


@pytest.mark.slow
def test_what_a_head_cannot_show_is_told_by_region(solved: AnchorSolver) -> None:
    vocabulary = Vocabulary.load(P)
    found = {region: (wanted, left) for region, wanted, left in
             residual_rows(solved, {"happiness": vocabulary["happiness"].weights}, P)}  # fmt: skip
    assert found["mouth"][1] < 0.6 * found["mouth"][0]
    told = check_anything("head24-anchors")
    assert any("mouth: emotions move it" in line for line in told)
    assert sum("a further servo would help most in the region" in line for line in told) == 2


def emotions() -> dict[str, np.ndarray]:
    vocabulary = Vocabulary.load(P)
    return {n: vocabulary[n].weights for n in vocabulary.names if vocabulary[n].kind == "emotion"}


def test_no_other_place_or_direction_would_help_more(solved: AnchorSolver) -> None:
    """Against every sampled point in many directions, tried one by one."""
    best = next(suggest_servos(solved, emotions(), P))
    left = np.array([solved.residual(solved.shape_values(face)) for face in emotions().values()])
    rng = np.random.default_rng(1)
    tried = []
    for j in rng.choice(len(solved.skin.rest), 120, replace=False):
        away = np.linalg.norm(solved.skin.rest - solved.skin.rest[j], axis=1)
        share = np.clip(1 - (away / 15.0) ** 2, 0, None) ** 2 * (1 - np.abs(solved.skin.jaw - solved.skin.jaw[j]))
        for direction in rng.normal(size=(12, 3)):
            field = (share[:, None] * direction / np.linalg.norm(direction)).ravel()
            after = [each.ravel() - field * (each.ravel() @ field) / (field @ field) for each in left]
            tried.append(np.sqrt((np.array(after) ** 2).sum(axis=1).mean() / len(share)))
    assert best.skin_after_mm <= min(tried) + 1e-9
    assert best.skin_before_mm == pytest.approx(np.sqrt((left**2).sum(axis=2).mean()))


@pytest.mark.slow
def test_the_suggested_servo_leaves_no_more_than_was_said(
    tmp_path: Path, head: Head, solved: AnchorSolver, root: Path
) -> None:
    """Written into the robot's file and solved together with the others, within its travel."""
    best = next(suggest_servos(solved, emotions(), P))
    pull = best.pull_mm + 0.1
    channel = f"""
[[channels]]
name = "further"
bus = "{solved_bus(root)}"
id = 200
model = "xl330-m288"
anchor = {{ point = {best.point.tolist()}, direction = {best.direction.tolist()} }}
map = {{ at = [{-pull}, {pull}], deg = [-40, 40] }}
limit_deg = [-45, 45]
max_speed_deg_s = 300
max_accel_deg_s2 = 3000
"""
    text = (root / "configs/robots/head24-anchors.toml").read_text(encoding="utf-8")
    (tmp_path / "robot.toml").write_text(text + channel)
    more = load_anchors(load_robot(tmp_path / "robot.toml", P), head, P)
    assert more is not None
    left = np.array([more.residual(more.shape_values(face)) for face in emotions().values()])
    near = np.linalg.norm(more.skin.rest - best.point, axis=1) < 15.0
    assert np.sqrt((left[:, near] ** 2).sum(axis=2).mean()) < 0.5 * (best.before_mm + best.after_mm)


def solved_bus(root: Path) -> str:
    """Of the last channel of the shipped example."""
    return load_robot(root / "configs/robots/head24-anchors.toml", P).channels[-1].bus


def test_both_pulls_on_either_side(tmp_path: Path, head: Head) -> None:
    robot = written(tmp_path, ROBOT.replace("[0, 1, 0] }", "[0, 1, 0], both = true }"))
    one = load_anchors(robot, head, P)
    assert one is not None
    field = one.field.reshape(-1, 3)
    assert np.all(field[one.skin.rest[:, 0] < -20, 1] >= 0)
    assert field[one.skin.rest[:, 0] < -20, 1].max() > 0.5


def _faults() -> Iterator[tuple[str, str, str]]:
    yield 'point = "corner"', 'point = "cornr"', "channels[0].anchor.point: no landmark called 'cornr', did you mean"
    yield "direction = [0, 1, 0]", "direction = [0, 0, 0]", "channels[0].anchor.direction: a direction must not be"
    yield "[0, 1, 0] }", '[0, 1, 0], part = "hair" }', "channels[0].anchor.part: 'hair' is not a skin part"
    yield "[0, 1, 0] }", '[0, 1, 0], like = "jawOpn" }', "channels[0].anchor.like: unknown parameter 'jawOpn'"
    yield "[0, 1, 0] }", '[0, 1, 0], like = "headYaw" }', "channels[0].anchor.like: the head has no shape"
    yield "[0, 1, 0] }", '[0, 1, 0], like = "eyeBlinkLeft" }', "channels[0].anchor.like: eyeBlinkLeft moves the point"
    yield "[0, 1, 0] }", '[0, 1, 0], like = "jawOpen", both = true }', "channels[0].anchor: both and like"
    yield "anchor =", "mix = { jawOpen = 1 }\nanchor =", "channels[0]: needs one of mix, formula and anchor"


@pytest.mark.parametrize(("old", "new", "fault"), list(_faults()))
def test_a_faulty_anchor_is_named_with_its_key(tmp_path: Path, head: Head, old: str, new: str, fault: str) -> None:
    assert old in ROBOT
    with pytest.raises(ConfigError) as caught:
        load_anchors(written(tmp_path, ROBOT.replace(old, new)), head, P)
    assert fault in str(caught.value)


def test_the_shipped_robot_differs_from_its_sister_only_in_its_mapping(robot: RobotSettings) -> None:
    other = load_robot(find_config("robots", "head24"), P)
    assert [(c.name, c.id, c.limit_deg) for c in robot.channels] == [
        (c.name, c.id, c.limit_deg) for c in other.channels
    ]
    assert robot.rules == other.rules
    assert len(tomllib.loads(find_config("robots", "head24-anchors").read_text())["landmarks"]) >= 10


def test_pulls_end_where_the_trimmed_map_meets_the_limits(tmp_path: Path) -> None:
    channel = written(tmp_path, ROBOT).channels[0]
    assert pull_range_mm(channel) == (-5.0, 10.0)
    assert pull_range_mm(channel.model_copy(update={"trim_deg": 6.0})) == (-5.0, 0.0)  # 46 degrees is too far
    assert pull_range_mm(channel.model_copy(update={"trim_deg": -6.0})) == (0.0, 10.0)
    assert pull_range_mm(channel.model_copy(update={"limit_deg": (-20.0, 40.0)})) == (-5.0, 10.0)


def test_every_fault_of_the_anchors_is_listed_at_once(tmp_path: Path, head: Head) -> None:
    second = ROBOT[ROBOT.index("[[channels]]") :].replace('"corner"', '"lip"').replace("id = 1", "id = 2")
    second = second.replace('point = "lip"', 'point = "corner"')
    text = ROBOT.replace("[0, 1, 0] }", '[0, 1, 0], like = "headYaw" }')
    text += second.replace("[0, 1, 0] }", '[0, 1, 0], part = "hair" }')
    with pytest.raises(ConfigError, match="2 faults") as caught:
        load_anchors(written(tmp_path, text), head, P, where="mine.toml")
    message = str(caught.value)
    assert message.startswith("mine.toml: ") and "omote check mine.toml" in caught.value.hint
    assert "channels[0].anchor.like: the head has no shape" in message and "channels[1].anchor.part: 'hair'" in message


def test_records_cannot_be_changed() -> None:
    for record in (SkinSamples, PullRows):
        with pytest.raises(FrozenInstanceError):
            object.__new__(record).anything = 1
