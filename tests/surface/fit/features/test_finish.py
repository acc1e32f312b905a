"""What is put on top of a fitted head."""

import numpy as np
import pytest
from face_measures import lips_gap
from slit_sheet import slit_sheet
from small_head import all_points, part, small_head

from surface import DCPSurface
from surface.fit.features.finish import (
    COLUMNS,
    FADE_ROWS,
    ROWS,
    add_correctives,
    find_contacts,
    finish_head,
    lip_gaps,
    part_lips,
    sample_places,
)
from surface.fit.points.recipe import Recipe
from surface.head import Head
from surface.head.model.data import PartData
from surface.head.model.file import load_data
from surface.head.model.meshes import make_surface
from surface.head.model.parameters import SHAPES
from surface.head.model.rules import Drivers


def test_a_head_without_openings_stays_as_it_is():
    head = small_head()
    assert finish_head(head, slit_sheet(), {}, Recipe([])) is head


@pytest.mark.slow
def test_the_shipped_head_stands_at_rest_where_its_contacts_put_it(root):
    head = Head(load_data(root / "configs" / "heads" / "ict"))
    before = {p.name: p.vertices.copy() for p in head.parts}
    head.pose(head.values({"jawOpen": 1.0, "eyeBlinkLeft": 1.0}))
    head.pose(head.values({}))
    for p in head.parts:
        assert np.abs(p.vertices - before[p.name]).max() < 0.3, p.name


def test_the_shipped_head_has_a_rule_for_every_group_that_is_no_parameter(root):
    data = load_data(root / "configs" / "heads" / "ict")
    extra = {g.name for p in data.parts for g in p.groups if g.name not in SHAPES}
    assert extra == {r.group for r in data.rules}


LEFT, UP = (4.0, 0.0, 0.0), (0.0, 6.0, 0.0)


@pytest.fixture
def mended():
    groups = [all_points("mouthLeft", LEFT), all_points("mouthShrugLower", UP)]
    head = small_head(parts=[part("a", -40, groups=groups), part("b", 0.5)], seams=[])
    return add_correctives(head, [{"shapes": ["mouthLeft", "mouthShrugLower"], "subtract": {"mouthShrugLower": 0.4}}])


@pytest.mark.parametrize(("one", "other"), [(0, 0), (1, 0), (0, 1), (1, 1), (0.5, 0.5), (0.25, 1)])
def test_a_share_is_taken_back_by_the_product(mended, one, other):
    head = Head(mended)
    rest = head.part("a").control_points.copy()
    head.pose(head.values({"mouthLeft": one, "mouthShrugLower": other}))
    wanted = np.array(LEFT) * one + np.array(UP) * (other - 0.4 * one * other)
    np.testing.assert_allclose(head.part("a").control_points - rest, np.tile(wanted, (25, 1)), atol=1e-5)


def test_parts_that_neither_shape_moves_get_no_group(mended):
    assert [g.name for g in mended.parts[0].groups][-1] == "mouthLeft*mouthShrugLower"
    assert mended.parts[1].groups == []
    assert [(r.group, r.power) for r in mended.rules] == [("mouthLeft*mouthShrugLower", 1.0)]


@pytest.mark.slow
def test_rolled_lips_stay_together(root):
    head = Head.load(root / "configs" / "heads" / "ict")
    head.pose(head.values({"mouthRollLower": 1.0, "mouthRollUpper": 1.0}))
    assert lips_gap(head) < 0.45


@pytest.fixture(scope="module")
def data(root):
    return load_data(root / "configs" / "heads" / "ict")


@pytest.fixture(scope="module")
def lips(data):
    return next(c for c in data.contacts if c.name == "lips")


@pytest.mark.slow
def test_it_is_measured_how_far_shapes_part_lips_that_nothing_keeps_together(data, lips):
    """That shipped head's sneer alone would lift the upper lip off the lower one; its smile would not."""
    gaps = lip_gaps(data, lips)
    assert set(gaps) == {g.name for p in data.parts if p.name == lips.part for g in p.groups} & set(SHAPES)
    assert gaps["noseSneerLeft"] > 4.5 and gaps["mouthFunnel"] > 10.0 and gaps["mouthSmileLeft"] < 1.0


@pytest.mark.slow
def test_only_shapes_that_part_lips_widely_may_open_those_of_a_mesh(data, lips):
    before = lips.seal.opens
    found = next(c for c in part_lips(data, 1.0).contacts if c.name == "lips").seal.opens
    wide = {"noseSneerLeft", "noseSneerRight", "mouthShrugUpper"}
    assert found == {**before, **dict.fromkeys(wide, 1.4)}
    assert next(c for c in part_lips(data, 3.0).contacts if c.name == "lips").seal.opens == before


@pytest.fixture(scope="module")
def contacts(data):
    return find_contacts(data.parts[0], data.eyes, data.eye_radius, tuple(p.name for p in data.parts))


def test_every_opening_is_found_with_what_lines_it(contacts):
    assert {c.name: (c.eye, c.followers) for c in contacts} == {
        "lips": (-1, ("cavity",)), "left_lids": (0, ("lashes", "sockets")), "right_lids": (1, ("lashes", "sockets")),
    }  # fmt: skip


def test_a_head_without_eyes_has_lips_only_at_its_slits(data):
    names = [c.eye for c in find_contacts(data.parts[0], np.zeros((2, 3)), 0.0, ("face",))]
    assert set(names) == {-1}


def test_samples_begin_at_the_rim_and_go_along_the_skin(data, contacts):
    surface = make_surface(data.parts[0])
    for contact in contacts:
        assert contact.places.shape == (2, COLUMNS, ROWS + FADE_ROWS, 2)
        at = surface.evaluate(contact.places.reshape(-1, 2)).reshape(*contact.places.shape[:3], 3)
        assert np.isfinite(at).all()
        assert (np.diff(at[..., 0].mean(axis=2), axis=1) > 0).all()  # columns side by side, from right to left
        length = np.linalg.norm(np.diff(at, axis=2), axis=3).sum(axis=2)
        middle = length[:, COLUMNS // 4 : -COLUMNS // 4]
        wanted = (15.0 if contact.eye < 0 else 0.58 * data.eye_radius) + contact.reach_mm
        np.testing.assert_allclose(middle, wanted, rtol=0.35)
        upper, lower = at[0, COLUMNS // 2], at[1, COLUMNS // 2]
        assert upper[-1, 1] > upper[0, 1] and lower[-1, 1] < lower[0, 1]


def test_columns_keep_their_place_across_the_opening(data):
    surface, loop = make_surface(data.parts[0]), data.parts[0].loops[1]
    places = sample_places(surface, loop, 6.0, 4.0)
    x = surface.evaluate(places.reshape(-1, 2)).reshape(*places.shape[:3], 3)[..., 0]
    assert np.abs(x - x[..., :1])[:, 3:-3].max() < 1.5


def almond() -> np.ndarray:
    """A hole of 0.3 by 0.1 in (u, v) around (0.5, 0.45)."""
    t = np.linspace(-1, 1, 25)
    upper = np.column_stack([0.5 + 0.15 * t, 0.45 + 0.05 * np.cos(t * np.pi / 2)])
    return np.vstack([upper, (upper * [1, -1] + [0, 0.9])[::-1][1:-1]])


def test_samples_of_an_opening_go_outwards_at_constant_x_by_their_length_on_the_skin():
    """A plane, 200 by 100 mm, tilted so that a millimetre along it is 0.8 mm of height."""
    net = np.array([[[x, 80.0 * v, 60.0 * v] for v in (0.0, 1.0)] for x in (-100.0, 100.0)])
    surface = DCPSurface.from_nurbs(1, 1, [0, 0, 1, 1], [0, 0, 1, 1], net)
    loop = almond()
    places = sample_places(surface, loop, 8.0, 5.0)
    assert places.shape == (2, COLUMNS, ROWS + FADE_ROWS, 2)
    at = surface.evaluate(places.reshape(-1, 2)).reshape(*places.shape[:3], 3)
    x = np.linspace(-30 + 0.03 * 60, 30 - 0.03 * 60, COLUMNS)  # the hole is 60 mm wide
    np.testing.assert_allclose(at[..., 0], np.broadcast_to(x[None, :, None], at.shape[:3]), atol=0.4)
    half = np.cos(x / 30 * np.pi / 2) * 5.0  # of the hole's height, mm along the skin
    wanted = np.concatenate([np.linspace(0.0, 8.0, ROWS), 8.0 + np.linspace(1.0, 5.0, FADE_ROWS)])
    for side, sign in ((0, 1.0), (1, -1.0)):
        along = sign * (at[side, :, :, 1] / 0.8 - 45.0)
        np.testing.assert_allclose(along, half[:, None] + wanted, atol=0.15)


def plane_with_holes(slit: tuple[float, float, float]) -> PartData:
    """A plane, 200 by 200 mm, with a hole that has no slit, and one of 60 by 20 mm around (0, -10, 0) that has."""
    net = np.array([[[x, y, 0.0] for y in (-100.0, 100.0)] for x in (-100.0, 100.0)])
    surface = DCPSurface.from_nurbs(1, 1, [0, 0, 1, 1], [0, 0, 1, 1], net)
    ku, kv = surface.padded
    outline, hole = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), almond()
    return PartData(
        "face", "skin", "skin", surface.points.copy(), surface.weights.copy(), ku.copy(), kv.copy(),
        np.stack(surface.degrees, axis=1), [outline, hole * 0.1 + [0.8, 0.8], hole], np.array([slit]), (0, 0.1, 4), [],
        jaw=np.zeros(4), lids=np.zeros(4),
    )  # fmt: skip


SLIT = (0.45, 0.35, 0.65)
NAMES = ("face", "sockets", "cavity", "lashes", "teeth")


@pytest.mark.parametrize("radius", [0.5, 12.0])
@pytest.mark.parametrize(("away", "lids"), [(1.49, True), (1.51, False)])
def test_lids_are_an_opening_before_an_eyeball_and_lips_any_other(radius: float, away: float, lids: bool):
    eyes = np.array([[500.0, 0, 0], [0.0, -10.0, -away * radius]])
    (contact,) = find_contacts(plane_with_holes(SLIT), eyes, radius, NAMES)
    assert (contact.name, contact.eye) == (("right_lids", 1) if lids else ("lips", -1))
    assert contact.part == "face" and contact.followers == (("lashes", "sockets") if lids else ("cavity",))
    assert (contact.reach_mm, contact.share) == ((0.5 * radius, 0.8) if lids else (12.0, 0.5))
    depth = 0.58 * radius if lids else 15.0
    y = 200.0 * contact.places[0, COLUMNS // 2, :, 1]
    np.testing.assert_allclose(np.ptp(y[:ROWS]), depth, rtol=0.03)
    np.testing.assert_allclose(np.ptp(y), depth + contact.reach_mm, rtol=0.03)


@pytest.mark.parametrize(
    ("start", "end", "found"),
    [(0.35, 0.65, 1), (0.4, 0.6, 1), (0.35 - 1e-10, 0.65 + 1e-10, 1), (0.3499, 0.6, 0), (0.4, 0.6501, 0)],
)
def test_an_opening_is_a_hole_that_holds_a_slit_from_end_to_end(start: float, end: float, found: int):
    face = plane_with_holes((0.45, start, end))
    assert len(find_contacts(face, np.zeros((2, 3)), 0.0, ("face",))) == found


def test_corrections_take_back_only_what_is_named_and_more_than_a_thousandth():
    groups = [all_points("mouthLeft", (1.0, 0, 0)), all_points("cheekPuff", (0, 3.0, 0))]
    groups[0].moves[5:, 0] = 0.0019
    groups[0].moves[7:, 0] = 0.0021
    head = small_head(parts=[part("a", -40, groups=groups)], seams=[])
    table = [{"shapes": ["mouthLeft", "jawOpen"], "subtract": {"mouthLeft": 0.5}}]
    group = add_correctives(head, table).parts[0].groups[-1]
    assert group.name == "mouthLeft*jawOpen" and group.ids.tolist() == [*range(5), *range(7, 25)]
    np.testing.assert_allclose(group.moves[[0, -1]], [[-0.5, 0, 0], [-0.00105, 0, 0]], atol=1e-8)


def test_a_gain_reaches_the_whole_of_a_corrective_earlier(data):
    pair = {"shapes": ["jawOpen", "jawOpen"], "subtract": {"mouthSmileLeft": -1.0}}
    head = add_correctives(data, [pair | {"gain": 2.0, "unless": "mouthClose"}])
    rule = head.rules[-1]
    found = []
    for value, shut in ((0.0, 0.0), (0.25, 0.0), (0.5, 0.0), (1.0, 0.0), (0.5, 0.25), (1.0, 1.0)):
        shapes = np.zeros(len(SHAPES))
        shapes[SHAPES.index("jawOpen")], shapes[SHAPES.index("mouthClose")] = value, shut
        found.append(float(Drivers([rule]).amounts(shapes)[-1]))
    assert found == [0.0, 0.25, 1.0, 1.0, 0.25, 0.0]


def test_an_open_mouth_shows_the_lower_teeth(root):
    head = Head.load(root / "configs" / "heads" / "ict")
    for value in (0.65, 1.0):
        head.pose(head.values({"jawOpen": value}))
        face, teeth = (head.part(name).vertices for name in ("face", "teeth_lower"))
        middle = face[(np.abs(face[:, 0]) < 2.0) & (face[:, 2] > 90.0) & (face[:, 1] < -42.0)]
        edge = teeth[(np.abs(teeth[:, 0]) < 4.0) & (teeth[:, 2] > 80.0), 1].max()
        assert edge > middle[:, 1].max() + 0.5, value
