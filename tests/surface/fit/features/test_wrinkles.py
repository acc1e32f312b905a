"""Control points put in along a line: at rest they change next to nothing, sunk they make a furrow."""

from dataclasses import replace

import numpy as np
import pytest
from slit_sheet import slit_sheet
from small_head import part

from surface import DCPSurface
from surface.fit.features.wrinkles import DEEPENED, add_wrinkles, with_deep_wrinkles
from surface.fit.source.chart import make_chart
from surface.fit.source.islands import find_islands
from surface.fit.source.mesh import FitMesh
from surface.head.model.data import Group
from surface.head.model.meshes import make_surface

MESH = slit_sheet()
CHART = make_chart(MESH, find_islands(MESH), normalise=False)
DEPTH, WIDTH, Y = 1.0, 4.0, 40.0
TABLE = {
    "group": "wrinkleTestLeft", "terms": [{"mouthSmileLeft": 1.0}], "depth": DEPTH, "width": WIDTH,
    "lines": [[[10.0, Y], [40.0, Y], [70.0, Y]]],
}  # fmt: skip


def height(x, y):
    return 40.0 * np.cos(3 * x / 200) * np.cos(3 * y / 200)


def face():
    """The sheet's shape as a net of 27 x 27 points that reproduces it to a tenth of a millimetre."""
    n = 27
    knots = np.concatenate([[0] * 4, np.linspace(0, 1, n - 2)[1:-1], [1] * 4])
    at = np.array([knots[i + 1 : i + 4].mean() for i in range(n)])
    x, y = np.meshgrid(200 * (at - 0.5), 200 * (at - 0.5), indexing="ij")
    s = DCPSurface.from_nurbs(3, 3, knots, knots, np.stack([x, y, height(x, y)], -1), np.ones((n, n)))
    ku, kv = s.padded
    smile = Group("mouthSmileLeft", np.arange(s.n, dtype=np.int32), np.full((s.n, 3), [3, 0, 0], np.float32))
    return replace(
        part("face", 0), points=s.points.copy(), weights=s.weights.copy(), knots_u=ku.copy(), knots_v=kv.copy(),
        degrees=np.stack(s.degrees, axis=1), groups=[smile], jaw=np.full(s.n, 0.25), lids=np.zeros(s.n),
    )  # fmt: skip


@pytest.fixture(scope="module")
def wrinkled():
    return add_wrinkles(face(), CHART, MESH, [TABLE])


def group(part, name):
    return next(g for g in part.groups if g.name == name)


def across(part, points, x=40.0):
    """y and what the surface is above the plain one, along a cut at constant x."""
    y = np.linspace(Y - 25, Y + 25, 201)
    uv = np.column_stack([np.full_like(y, x / 200 + 0.5), y / 200 + 0.5])
    return y, (make_surface(part).with_points(points).evaluate(uv) - make_surface(face()).evaluate(uv))[:, 2]


def test_the_points_stand_along_the_line_on_the_surface(wrinkled):
    part, _ = wrinkled
    own = part.points[face().points.shape[0] :]
    assert len(own) == len(group(part, "wrinkleTestLeft").ids) > 5
    np.testing.assert_allclose(own[:, 1], Y, atol=1.2)  # the mesh is coarse, 8 mm
    np.testing.assert_allclose(own[:, 2], height(*own[:, :2].T), atol=0.3)
    assert own[0, 0] == pytest.approx(10, abs=1) and own[-1, 0] == pytest.approx(70, abs=1)


def test_at_rest_they_change_next_to_nothing(wrinkled):
    part, _ = wrinkled
    assert np.abs(across(part, part.points)[1]).max() < 0.06


def test_they_follow_every_group_and_the_jaw_as_the_skin_around_does(wrinkled):
    part, _ = wrinkled
    smile = group(part, "mouthSmileLeft")
    np.testing.assert_allclose(smile.moves, np.tile([3, 0, 0], (len(part.points), 1)), atol=1e-4)
    np.testing.assert_allclose(part.jaw, 0.25)


def test_sunk_they_make_a_furrow_of_the_wanted_depth_and_width(wrinkled):
    part, _ = wrinkled
    fold = group(part, "wrinkleTestLeft")
    points = part.points.copy()
    points[fold.ids] += fold.moves
    y, rise = across(part, points)
    assert rise.min() == pytest.approx(-DEPTH, rel=0.07)
    assert y[rise.argmin()] == pytest.approx(Y, abs=0.5)
    half = y[rise < 0.5 * rise.min()]
    assert 0.7 * WIDTH < np.ptp(half) < 1.8 * WIDTH
    assert np.abs(rise[np.abs(y - Y) > 3 * WIDTH]).max() < 0.05


def test_a_mirrored_table_makes_the_other_side(wrinkled):
    part, rules = add_wrinkles(face(), CHART, MESH, [TABLE | {"mirror": True}])
    assert [(r.group, r.terms, r.power) for r in rules] == [
        ("wrinkleTestLeft", ({"mouthSmileLeft": 1.0},), 2.0),
        ("wrinkleTestRight", ({"mouthSmileRight": 1.0},), 2.0),
    ]
    left, right = (part.points[group(part, f"wrinkleTest{s}").ids] for s in ("Left", "Right"))
    np.testing.assert_allclose(left, right * [-1, 1, 1], atol=0.05)


def test_raised_lines_come_out():
    table = TABLE | {"lines": [], "raised": TABLE["lines"], "rise": 0.8}
    part, _ = add_wrinkles(face(), CHART, MESH, [table])
    fold = group(part, "wrinkleTestLeft")
    points = part.points.copy()
    points[fold.ids] += fold.moves
    assert 0.55 < across(part, points)[1].max() < 1.0


def test_deepened_points_are_for_cutting_triangles_only(wrinkled):
    part, _ = wrinkled
    fold = group(part, "wrinkleTestLeft")
    out = with_deep_wrinkles(part, part.points)
    np.testing.assert_allclose(out[fold.ids] - part.points[fold.ids], DEEPENED * fold.moves, atol=1e-9)
    assert out is not part.points


def test_without_wishes_the_face_stays_as_it_is():
    plain = face()
    assert add_wrinkles(plain, CHART, MESH, []) == (plain, [])


def slopes(x, y):
    """Derivatives of the sheet's height, mm per mm."""
    fx, fy = 3 / 200 * x, 3 / 200 * y
    return -0.6 * np.sin(fx) * np.cos(fy), -0.6 * np.cos(fx) * np.sin(fy)


def own_points(part):
    return np.arange(len(face().points), len(part.points))


def test_points_are_nearly_two_widths_apart_but_a_short_line_has_three(wrinkled):
    part, _ = wrinkled
    x = np.linspace(10.0, 70.0, 601)
    length = np.hypot(np.diff(x), np.diff(height(x, Y))).sum()
    assert len(own_points(part)) == round(length / (1.8 * WIDTH)) + 1
    gaps = np.linalg.norm(np.diff(part.points[own_points(part)], axis=0), axis=1)
    np.testing.assert_allclose(gaps, length / len(gaps), rtol=0.12)
    short, _ = add_wrinkles(face(), CHART, MESH, [TABLE | {"lines": [[[10.0, Y], [13.0, Y]]]}])
    assert len(own_points(short)) == 3


def test_spans_are_as_wide_as_the_furrow_across_it_and_as_long_as_the_points_are_apart(wrinkled):
    part, _ = wrinkled
    own = own_points(part)
    across, along = part.knots_v[own], part.knots_u[own]
    assert across.shape == along.shape == (len(own), 5)
    for knots in (across, along):
        np.testing.assert_allclose(np.diff(knots, axis=1), np.diff(knots, axis=1)[:, :1] * np.ones((1, 4)))
    x, y = 200 * (along[:, 2] - 0.5), 200 * (across[:, 2] - 0.5)
    steep = np.hypot(1.0, slopes(x, y)[1])
    np.testing.assert_allclose(200 * np.diff(across, axis=1)[:, 0] * steep, 0.62 * WIDTH, rtol=0.03)
    np.testing.assert_allclose(np.diff(along, axis=1)[:, 0], np.gradient(along[:, 2]), rtol=1e-6)
    assert (part.degrees[own] == 3).all() and (part.weights[own] == 1).all()


def test_points_of_a_wrinkle_move_along_the_normals_of_the_skin(wrinkled):
    part, _ = wrinkled
    fold = group(part, "wrinkleTestLeft")
    dx, dy = slopes(*part.points[fold.ids, :2].T)
    normal = np.column_stack([-dx, -dy, np.ones_like(dx)])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    amount = (fold.moves * normal).sum(axis=1)
    assert (amount[1:-1] < 0.0).all()
    assert np.abs(amount[[0, -1]]).max() < 0.05 * np.abs(amount).max(), "its ends run out"
    np.testing.assert_allclose(fold.moves, amount[:, None] * normal, atol=0.03 * np.abs(amount).max())


def along(part, points):
    """x and what the surface is above the plain one, along the line."""
    x = np.linspace(0.0, 80.0, 161)
    uv = np.column_stack([x / 200 + 0.5, np.full_like(x, Y / 200 + 0.5)])
    return x, (make_surface(part).with_points(points).evaluate(uv) - make_surface(face()).evaluate(uv))[:, 2]


def sunk(part):
    points = part.points.copy()
    for g in part.groups:
        if g.name.startswith("wrinkle"):
            points[g.ids] += g.moves
    return points


def test_a_furrow_runs_out_at_its_ends(wrinkled):
    part, _ = wrinkled
    x, rise = along(part, sunk(part))
    whole = rise[(x > 30) & (x < 50)].mean()
    for end in (10.0, 70.0):
        assert abs(rise[np.abs(x - end) < 0.8].mean() / whole) < 0.4
    assert rise[(x > 25) & (x < 32)].mean() / whole > 0.8 and np.abs(rise[x < 1.0]).max() < 0.05
    assert rise.min() > -1.1 * DEPTH


def test_two_lines_sink_together_and_depth_is_proportional():
    lines = [*TABLE["lines"], [[10.0, -Y], [40.0, -Y], [70.0, -Y]]]
    part, _ = add_wrinkles(face(), CHART, MESH, [TABLE | {"lines": lines, "depth": 2.0 * DEPTH}])
    (fold,) = (g for g in part.groups if g.name == "wrinkleTestLeft")
    np.testing.assert_array_equal(fold.ids, own_points(part))
    upper, lower = np.split(fold.moves, 2)
    np.testing.assert_allclose(upper[:, 2], lower[:, 2], rtol=0.05)
    once = group(add_wrinkles(face(), CHART, MESH, [TABLE])[0], "wrinkleTestLeft")
    np.testing.assert_allclose(upper, 2.0 * once.moves, atol=0.03)


def test_a_line_raised_by_nothing_moves_nothing_and_power_is_as_wanted():
    table = TABLE | {"lines": [], "raised": TABLE["lines"], "power": 3.5}
    part, rules = add_wrinkles(face(), CHART, MESH, [table])
    assert not group(part, "wrinkleTestLeft").moves.any()
    assert [rule.power for rule in rules] == [3.5]


def test_mirrored_raised_lines_come_out_on_both_sides():
    table = TABLE | {"lines": [], "raised": TABLE["lines"], "rise": 0.8, "mirror": True}
    part, rules = add_wrinkles(face(), CHART, MESH, [table])
    assert [rule.group for rule in rules] == ["wrinkleTestLeft", "wrinkleTestRight"]
    for x in (40.0, -40.0):
        assert 0.55 < across(part, sunk(part), x)[1].max() < 1.0


def test_groups_elsewhere_get_no_points_of_the_wrinkle_and_lids_are_followed():
    plain = face()
    ids = np.flatnonzero(plain.points[:, 0] < -40).astype(np.int32)
    far = Group("mouthSmileRight", ids, np.full((len(ids), 3), [0, 2, 0], np.float32))
    part, _ = add_wrinkles(replace(plain, groups=[far], lids=np.full(len(plain.points), 0.5)), CHART, MESH, [TABLE])
    np.testing.assert_array_equal(group(part, "mouthSmileRight").ids, ids)
    np.testing.assert_array_equal(group(part, "mouthSmileRight").moves, far.moves)
    np.testing.assert_allclose(part.lids, 0.5)


def test_deepening_leaves_all_other_points(wrinkled):
    part, _ = wrinkled
    out = with_deep_wrinkles(part, part.points)
    np.testing.assert_array_equal(out[: len(face().points)], face().points)
    assert DEEPENED == 1.5


@pytest.mark.parametrize("angle", [0.0, 90.0, 45.0, -30.0])
def test_furrows_are_as_deep_in_any_direction(angle):
    forward = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    left = np.array([-forward[1], forward[0]])
    line = [(np.array([30.0, 35.0]) + t * forward).tolist() for t in (-30.0, 0.0, 30.0)]
    part, _ = add_wrinkles(face(), CHART, MESH, [TABLE | {"lines": [line]}])
    aside = np.linspace(-15, 15, 121)
    uv = ([30.0, 35.0] + aside[:, None] * left) / 200 + 0.5
    rise = make_surface(part).with_points(sunk(part)).evaluate(uv) - make_surface(face()).evaluate(uv)
    deep = np.linalg.norm(rise, axis=1)
    assert 0.75 * DEPTH < deep.max() < 1.15 * DEPTH and abs((deep * aside).sum() / deep.sum()) < 1.0
    if angle in (0.0, 90.0):  # one askew is wider: its knots lie along u and v
        assert np.ptp(aside[deep > 0.5 * deep.max()]) == pytest.approx(1.1 * WIDTH, rel=0.3)
    assert deep[np.abs(aside) > 3.0 * WIDTH].max() < 0.02


def test_groups_that_move_the_skin_little_move_the_wrinkle_as_little():
    plain = face()
    little = Group("browInnerUp", np.arange(len(plain.points), dtype=np.int32),
                   np.full((len(plain.points), 3), [0.0, 0.5678, 0.0], np.float32))  # fmt: skip
    part, _ = add_wrinkles(replace(plain, groups=[little]), CHART, MESH, [TABLE])
    moves = group(part, "browInnerUp").moves
    np.testing.assert_allclose(moves, np.tile([0, 0.5678, 0], (len(part.points), 1)), atol=5e-5)


def test_a_line_lies_on_what_is_in_front_even_where_samples_of_the_back_are_nearer():
    n = len(MESH.vertices)
    behind = MESH.vertices + np.array([0.5, 0.5, -100.0])
    both = FitMesh(
        np.vstack([MESH.vertices, behind]), np.vstack([MESH.faces, MESH.faces + n]),
        np.vstack([MESH.uv, MESH.uv + np.array([2.0, 0.0])]), np.vstack([MESH.face_uv, MESH.face_uv + n]),
        MESH.names, np.concatenate([MESH.deltas, MESH.deltas], axis=1),
    )  # fmt: skip
    chart = make_chart(both, find_islands(both))
    y = 125.0 / 3 + 0.5
    part, _ = add_wrinkles(face(), chart, both, [TABLE | {"lines": [[[10.0, y], [40.0, y], [70.0, y]]]}])
    own = part.points[own_points(part)]
    np.testing.assert_allclose(own[:, 2], height(*own[:, :2].T), atol=0.3)
