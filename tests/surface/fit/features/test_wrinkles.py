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
    assert -1.15 * DEPTH < rise.min() < -0.75 * DEPTH
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
