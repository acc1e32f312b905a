"""The shipped head: geometry in every parameter, and the behaviour of Head."""

import numpy as np
import pytest
from small_head import part, small_head

from surface.base.errors import HeadFileError
from surface.head import NAMES, Head
from surface.head.model.file import save_data
from surface.head.posing.part import border_edges


@pytest.fixture(scope="module")
def head(root) -> Head:
    return Head.load(root / "configs" / "heads" / "ict")


@pytest.fixture
def face(head):
    head.pose(head.values({}))
    return head.part("face")


def posed(head: Head, **values: float) -> np.ndarray:
    head.pose(head.values(values))
    return head.part("face").vertices.astype(float)


def loops(p) -> list[np.ndarray]:
    """Closed border loops as vertex ids, the longest first."""
    after = dict(border_edges(p.mesh.triangles).tolist())
    out = []
    while after:
        start, at = after.popitem()
        ids = [start]
        while at != start:
            ids.append(at)
            at = after.pop(at)
        out.append(np.array(ids))
    return sorted(out, key=len, reverse=True)


@pytest.fixture(scope="module")
def holes(head) -> dict[str, np.ndarray]:
    """Border loops of the face by name."""
    head.pose(head.values({}))
    face = head.part("face")
    middles = {"mouth": [0, -33, 105], "left": head.data.eyes[0], "right": head.data.eyes[1]}
    every = loops(face)
    return {
        n: min(every, key=lambda ids: np.linalg.norm(face.vertices[ids].mean(axis=0) - m - [0, 0, 8 * (n != "mouth")]))
        for n, m in middles.items()
    }


def gap(head: Head, points: np.ndarray, ids: np.ndarray) -> float:
    """Height of an opening in its middle third, between its upper and its lower rim as (u, v) tells them."""
    p, uv = points[ids], head.part("face").mesh.uv[ids]
    u, v = uv[:, 0], uv[:, 1]
    middle = np.abs(u - 0.5 * (u.min() + u.max())) < np.ptp(u) / 6
    upper = v > 0.5 * (v.min() + v.max())
    return float(p[middle & upper, 1].mean() - p[middle & ~upper, 1].mean())


def test_it_knows_all_59_parameters_and_has_a_group_for_every_shape(head):
    assert head.parameters == NAMES
    assert set(head.groups) == set(NAMES[:52])
    assert "face" in head.group("mouthPucker")
    with pytest.raises(KeyError, match="no group 'earWiggle'"):
        head.group("earWiggle")


def test_it_is_small_enough(head):
    assert len(head.part("face").surface.points) <= 2500
    assert sum(p.surface.n for p in head.parts) <= 8800
    assert sum(len(p.vertices) for p in head.parts) <= 52000


def test_parts_have_what_a_picture_needs(head):
    assert {p.material for p in head.parts} == {"skin", "eye", "teeth", "gums", "tongue", "mouth", "lash", "brow"}
    for p in head.parts:
        m = len(p.vertices)
        assert p.vertices.dtype == p.normals.dtype == p.uv.dtype == np.float32
        assert p.normals.shape == (m, 3) and p.uv.shape == (m, 2)
        assert p.triangles.dtype == np.int32 and p.triangles.min() >= 0 and p.triangles.max() < m
        assert all(a.shape[0] == m and np.isfinite(a).all() for a in p.attributes.values())
    assert set(head.part("face").attributes) >= {"albedo", "occlusion", "gloss"}
    local = head.part("eye_left").attributes["eye_local"]
    assert local[np.argmax(local[:, 2])][2] > 1.05  # the cornea


@pytest.mark.parametrize("name", [*NAMES, "all"])
def test_nothing_becomes_infinite_or_flies_away(head, name):
    head.pose(np.ones(59) if name == "all" else head.values({name: 1}))
    for p in head.parts:
        assert np.isfinite(p.vertices).all() and np.isfinite(p.normals).all()
        assert np.abs(p.vertices).max() < 260
        assert np.abs(np.linalg.norm(p.normals, axis=1) - 1).max() < 0.2


def test_random_mixtures_come_back_to_rest(head):
    head.pose(head.values({}))
    rest = [p.vertices.copy() for p in head.parts]
    rng = np.random.default_rng(1)
    for _ in range(40):
        head.pose(rng.uniform(-1, 1, 59))
    head.pose(head.values({}))
    for p, r in zip(head.parts, rest, strict=True):
        assert np.abs(p.vertices - r).max() < 2e-3


def test_faces_are_mirror_images(head):
    pairs = [n for n in NAMES[:52] if n.endswith("Left") and n not in ("jawLeft", "mouthLeft")]
    face = head.part("face").surface
    rng = np.random.default_rng(0)
    uv = rng.uniform([0.05, 0.2], [0.45, 0.95], (400, 2))
    twin = np.column_stack([1 - uv[:, 0], uv[:, 1]])
    for name in pairs:
        head.pose(head.values({name: 1}))
        left = face.with_points(head.part("face").control_points).evaluate(twin)
        head.pose(head.values({name[:-4] + "Right": 1}))
        right = face.with_points(head.part("face").control_points).evaluate(uv)
        off = np.linalg.norm(left * [-1, 1, 1] - right, axis=1)
        assert np.sqrt((off**2).mean()) < 0.3, name


def test_the_mouth_opens_steadily_and_closes_again(head, holes):
    heights = [gap(head, posed(head, jawOpen=j), holes["mouth"]) for j in np.linspace(0, 1, 6)]
    assert (np.diff(heights) > 3).all() and heights[-1] > 30
    for j in (0.3, 0.6, 1.0):
        assert gap(head, posed(head, jawOpen=j, mouthClose=j), holes["mouth"]) < heights[0] + 2.5


def lid_gap(head: Head, side: str) -> float:
    """Height of the opening between the lids' front edges, in its middle third."""
    part = head.part("face")
    middle = 0.65 if side == "Left" else 0.35
    rim = min((loop for loop in head.data.parts[0].loops[1:]), key=lambda loop: abs(loop[:, 0].mean() - middle))
    u = np.linspace(*np.quantile(rim[:, 0], [0.33, 0.67]), 7)
    now = part.surface.with_points(part.control_points)
    upper, lower = (
        now.evaluate(np.column_stack([u, np.full(7, v)])) for v in (rim[:, 1].max() + 0.014, rim[:, 1].min() - 0.014)
    )
    return float((upper - lower)[:, 1].mean())


@pytest.mark.parametrize(("side", "other"), [("Left", "Right"), ("Right", "Left")])
def test_a_blink_closes_one_eye_and_leaves_the_other(head, side, other):
    head.pose(head.values({}))
    rest = lid_gap(head, other)
    assert lid_gap(head, side) == pytest.approx(rest, abs=0.6) and rest > 7
    heights = []
    for value in (0.25, 0.5, 0.75, 1.0):
        head.pose(head.values({f"eyeBlink{side}": value}))
        heights.append(lid_gap(head, side))
        assert lid_gap(head, other) == pytest.approx(rest, abs=0.05)
    assert (np.diff(heights) < -1).all() and heights[-1] < 0.8


@pytest.mark.parametrize(
    ("name", "at", "axis", "sign", "least"),
    [
        ("jawOpen", [0, -75, 104], 1, -1, 20), ("mouthSmileLeft", [25, -35, 102], 1, 1, 4),
        ("mouthFrownLeft", [25, -35, 102], 1, -1, 2.5), ("browInnerUp", [12, 59, 107], 1, 1, 3),
        ("browDownRight", [-12, 59, 107], 1, -1, 1.5), ("cheekPuff", [45, -30, 85], 2, 1, 8),
        ("mouthPucker", [0, -28, 117], 2, 1, 3), ("noseSneerLeft", [14, -3, 110], 1, 1, 2),
        ("jawForward", [0, -75, 104], 2, 1, 6), ("jawLeft", [0, -75, 104], 0, 1, 4),
        ("mouthRight", [0, -40, 114], 0, -1, 4), ("eyeWideLeft", [31, 43, 95], 1, 1, 1.5),
    ],
)  # fmt: skip
def test_shapes_go_where_anatomy_says(head, name, at, axis, sign, least):
    rest = posed(head)
    near = np.argsort(np.linalg.norm(rest - at, axis=1))[:8]
    move = (posed(head, **{name: 1.0}) - rest)[near].mean(axis=0)
    assert sign * move[axis] > least


def test_the_jaw_takes_the_lower_teeth_along_rigidly(head):
    head.pose(head.values({}))
    lower, upper = head.part("teeth_lower"), head.part("teeth_upper")
    rest, still = lower.vertices.astype(float), upper.vertices.copy()
    head.pose(head.values({"jawOpen": 1}))
    now = lower.vertices.astype(float)
    step = len(rest) // 2
    np.testing.assert_allclose(
        np.linalg.norm(now - np.roll(now, step, axis=0), axis=1),
        np.linalg.norm(rest - np.roll(rest, step, axis=0), axis=1), atol=1e-3,
    )  # fmt: skip
    assert (rest - now)[:, 1].min() > 5
    np.testing.assert_array_equal(upper.vertices, still)


def test_the_head_turns_and_the_shoulders_stay(head):
    rest = posed(head)
    back = head.part("back").vertices.copy()
    low = back[:, 1] < -170
    turned = posed(head, headYaw=1.0)
    nose = np.argmax(rest[:, 2])
    assert turned[nose, 0] > 60
    assert np.abs(head.part("back").vertices[low] - back[low]).max() < 0.5


def test_gaze_turns_the_eyeballs_only_about_their_centres(head):
    head.pose(head.values({"eyeLookOutLeft": 1.0}))
    eye, local = head.part("eye_left"), head.part("eye_left").attributes["eye_local"]
    pupil = eye.vertices[np.argmax(local[:, 2])] - head.data.eyes[0]
    assert np.degrees(np.arctan2(pupil[0], pupil[2])) == pytest.approx(35, abs=0.5)


def test_seams_do_not_gape(head):
    for values in ({}, {"jawOpen": 1}, {"mouthSmileLeft": 1, "cheekPuff": 1}, {"headYaw": 1, "headPitch": -1}):
        head.pose(head.values(values))
        for stitch in head._stitches:
            if not len(stitch.ids):
                continue
            a, b = stitch.first.vertices, stitch.second.vertices
            want = a[stitch.low] + stitch.share[:, None] * (a[stitch.high] - a[stitch.low])
            if stitch.first is not stitch.second:
                away = np.linalg.norm(b[stitch.ids] - want, axis=1)  # none, or the overlap
                assert away == pytest.approx(np.abs(stitch.inward), abs=1e-3)


def test_only_what_moves_is_reported(head):
    head.pose(head.values({}))
    head.pose(head.values({}))
    assert all(p.changed == [] for p in head.parts)
    head.pose(head.values({"browInnerUp": 1}))
    assert head.part("face").changed and head.part("brows").changed
    assert not head.part("teeth_lower").changed and not head.part("tongue").changed


def test_arrays_stay_where_they_are(head):
    before = [(p.vertices, p.normals) for p in head.parts]
    head.pose(np.full(59, 0.5))
    assert all(p.vertices is v and p.normals is n for p, (v, n) in zip(head.parts, before, strict=True))


def test_a_bad_value_leaves_the_pose(head):
    before = posed(head, jawOpen=0.5)
    with pytest.raises(ValueError, match="not a number"):
        head.pose(np.full(59, np.nan))
    np.testing.assert_array_equal(head.part("face").vertices, before)
    with pytest.raises(KeyError):
        head.values({"jawOpem": 1})


def test_what_a_part_follows_is_checked(tmp_path):
    save_data(tmp_path, small_head(parts=[part("a", 0, "moon")], seams=[]))
    with pytest.raises(HeadFileError, match="'moon' is not one of"):
        Head.load(tmp_path)


def test_unknown_parts_are_named(head):
    with pytest.raises(KeyError, match="no part 'nose'"):
        head.part("nose")


def test_tilts_of_what_is_no_shape_are_refused(tmp_path):
    save_data(tmp_path, small_head())
    file = tmp_path / "head.toml"
    file.write_text(file.read_text().replace("jawForward", "jawForwards"))
    with pytest.raises(HeadFileError, match=r"jaw\.tilts\.jawForwards: is no shape"):
        Head.load(tmp_path)


def test_pupils_that_still_adapt_to_a_light_may_be_far_from_its_width() -> None:
    head = Head(small_head())
    head.live(0.0, 0.1)
    assert head.pupil == 0.1
    head.live(0.0, 9.0, 3.0)
    assert head.pupil == pytest.approx(3.0 * 1.25 - 1.0)
    head.live(0.0, 0.0, 0.4)
    assert head.pupil == pytest.approx(-0.6)
