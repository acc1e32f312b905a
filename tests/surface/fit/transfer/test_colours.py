"""A scan's colours on the head that is made in its form."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from surface.fit.source.textures import Samples
from surface.fit.transfer import colours
from surface.fit.transfer.colours import moved, scan_colours, with_colours
from surface.head import Head
from surface.readers.meshdata import Material, MeshData
from tests.surface.small_head import part as small_part
from tests.surface.small_head import small_head

SKIN, LIPS = np.array([0.30, 0.16, 0.10]), np.array([0.24, 0.05, 0.06])
IRIS, WHITE = np.array([0.05, 0.10, 0.20]), np.array([0.55, 0.53, 0.50])
LAYERS = [
    {"part": "a", "attribute": "albedo", "kind": "all", "value": [0.6, 0.37, 0.28]},
    {"part": "a", "attribute": "albedo", "kind": "region", "feather": 0.01, "amount": 0.5, "value": [0.4, 0.1, 0.1],
     "lines": [[[0.3, 0.3], [0.7, 0.3], [0.7, 0.7], [0.3, 0.7]]]},
    {"part": "a", "attribute": "albedo", "kind": "spots", "feather": 0.001, "width": 0.001, "value": [0.3, 0.185, 0.14],
     "lines": [[[0.9, 0.9]]]},
    {"part": "a", "attribute": "gloss", "kind": "all", "value": [0.7]},
]  # fmt: skip


def quads(colours=None, materials=()) -> MeshData:
    vertices = np.array([[x, y, 0] for y in range(3) for x in range(3)], float)
    faces = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
    uv, none = np.zeros((0, 2)), np.full((4, 4), -1)
    return MeshData(
        vertices, faces, uv, none, (), np.zeros((0, 9, 3)), np.zeros(4, int), ("x",), materials, colours=colours
    )


def test_colours_of_vertices_are_sampled_all_over_the_faces_that_are_kept():
    rows = np.repeat(np.linspace(0, 1, 3), 3)[:, None] * [1.0, 0.5, 0.0]
    found = scan_colours(quads(rows), np.array([True, True, False, False]))
    np.testing.assert_allclose(found.colour[:, 0], found.points[:, 1] / 2, atol=1e-12)
    assert found.points[:, 1].max() < 1 and found.weight.sum() == pytest.approx(2.0)
    turned = moved(found, np.eye(3)[[1, 2, 0]], 2.0, np.array([1.0, 0, 0]))
    np.testing.assert_allclose(turned.points[:, 0], 2 * found.points[:, 1] + 1)
    np.testing.assert_array_equal(turned.colour, found.colour)


def test_base_colours_are_taken_too_and_one_grey_says_nothing():
    red = scan_colours(quads(materials=(Material(colour=(0.5, 0.2, 0.1, 1.0)),)))
    np.testing.assert_allclose(red.colour[:, :3], np.tile([0.5, 0.2, 0.1], (len(red.colour), 1)))
    assert scan_colours(quads()) is None
    assert scan_colours(quads(np.full((9, 3), 0.21))) is None
    assert scan_colours(quads(np.repeat(np.linspace(0, 1, 3), 3)[:, None] * np.ones(3))) is not None  # a stone's


@pytest.fixture(scope="module")
def data():
    """A small head with fine triangles and an eyeball's part on either side."""
    head = small_head()
    face = replace(head.parts[0], budget=(0, 0.002, 5))
    eyes = [small_part(name, 200, name) for name in ("left_eye", "right_eye")]
    return replace(head, parts=[face, head.parts[1], *eyes], paint=LAYERS)


def samples_on(data, colour_at) -> Samples:
    part = Head(data).part("a")
    colour = np.array([colour_at(*uv) for uv in part.uv])
    return Samples(part.vertices.astype(float), np.column_stack([colour, np.ones(len(colour))]), np.ones(len(colour)))


def in_lips(u, v) -> bool:
    return 0.29 < u < 0.71 and 0.29 < v < 0.71


def test_the_head_has_the_scans_colours_where_it_shows_them(data):
    before = Head(data).part("a").attributes["albedo"]
    made, told = with_colours(data, samples_on(data, lambda u, v: LIPS if in_lips(u, v) else SKIN))
    part = Head(made).part("a")
    lips = np.array([0.32 < u < 0.68 and 0.32 < v < 0.68 for u, v in part.uv])
    skin = np.array([not (0.25 < u < 0.75 and 0.25 < v < 0.75) and u < 0.85 for u, v in part.uv])
    assert lips.sum() > 20 and skin.sum() > 20
    np.testing.assert_allclose(part.attributes["albedo"][lips], np.tile(LIPS, (lips.sum(), 1)), atol=0.01)
    np.testing.assert_allclose(part.attributes["albedo"][skin], np.tile(SKIN, (skin.sum(), 1)), atol=0.01)
    assert np.abs(before - part.attributes["albedo"]).max() > 0.1
    assert made.paint[3] == LAYERS[3] and "0.30 0.16 0.10" in told[0]
    np.testing.assert_allclose(made.paint[2]["value"], 0.5 * SKIN, atol=0.01)  # not seen: half the skin's, as before


def test_nothing_is_painted_where_the_scan_is_elsewhere(data):
    far = samples_on(data, lambda u, v: SKIN)
    assert with_colours(data, replace(far, points=far.points + 1000.0)) == (data, [])


def ball(data, side, iris, white, count=6000) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(side)
    out = rng.normal(size=(count, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    angle = np.arccos(out[:, 2])
    colour = np.where((angle < 0.52)[:, None], iris, white)
    return data.eyes[side] + data.eye_radius * out, colour


def test_open_eyes_keep_their_colours_and_closed_ones_tell_none(data):
    skin = samples_on(data, lambda u, v: SKIN)
    for white, count in ((WHITE, 2), (SKIN, 0)):
        points, colour = zip(*(ball(data, side, IRIS, white) for side in (0, 1)), strict=True)
        every = Samples(
            np.vstack([skin.points, *points]),
            np.column_stack([np.vstack([skin.colour[:, :3], *colour]), np.ones(len(skin.points) + 12000)]),
            np.ones(len(skin.points) + 12000),
        )
        made, told = with_colours(data, every)
        eyes = [p.name for p in data.parts if p.follows in ("left_eye", "right_eye")]
        painted = [la for la in made.paint if la["part"] in eyes and la["attribute"] == "iris"]
        assert len(eyes) == 2 and len(painted) == count and told[0].count("iris") == count
        for layer in painted:
            np.testing.assert_allclose(layer["value"], IRIS, atol=0.01)


def test_eyes_of_their_own_tell_their_colours_behind_lids_and_however_deep_they_lie(data):
    """Before an iris that is set back behind a cornea, lids are what lies as far out as an eyeball."""
    skin = samples_on(data, lambda u, v: SKIN)
    lids, balls = ([ball(data, side, *two) for side in (0, 1)] for two in ((SKIN, SKIN), (IRIS, WHITE)))
    every = [skin.points, *(at for at, _ in lids)], [skin.colour[:, :3], *(c for _, c in lids)]
    deep = [data.eyes[side] + 0.8 * (at - data.eyes[side]) for side, (at, _) in enumerate(balls)]
    seen, eyes = (
        Samples(np.vstack(at), np.insert(np.vstack(rgb), 3, 1.0, axis=1), np.ones(sum(map(len, at))))
        for at, rgb in (every, (deep, [c for _, c in balls]))
    )
    assert with_colours(data, seen)[1][0].count("iris") == 0
    made, told = with_colours(data, seen, eyes)
    assert told[0].count("iris of the ") == 2
    parts = [p.name for p in data.parts if p.follows in ("left_eye", "right_eye")]
    for attribute, colour in (("iris", IRIS), ("sclera", WHITE)):
        painted = [la["value"] for la in made.paint if la["part"] in parts and la["attribute"] == attribute]
        np.testing.assert_allclose(painted, [colour, colour], atol=0.01)
    far = replace(eyes, points=eyes.points + 3.0 * data.eye_radius)
    assert with_colours(data, seen, far)[1][0].count("iris") == 0


def test_faces_of_eyes_are_those_of_eyeballs_and_irises_by_name():
    raw = replace(quads(), piece=np.arange(4), pieces=("skin", "high-poly", "cornea", "iris"))
    assert colours.eye_faces(raw, np.ones(4, bool)).tolist() == [False, True, False, True]
    assert colours.eye_faces(raw, np.array([True, False, True, True])).tolist() == [False, False, False, True]


def test_a_colour_is_the_mean_of_roots_of_six_samples_within_2_mm():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1.9, 0], [0, 0, 2.1], [50, 0, 0]])
    rgb = np.sqrt(np.array([[0.04, 0.0, 0.0], [0.16, 0.0, 0.0], [0.64, 0.0, 0.0], [1.0, 1.0, 1.0], [0.0, 1.0, 0.0]]))
    tree = cKDTree(points)
    seen, known = colours._looked_up(np.array([[0.0, 0, 0], [20, 0, 0], [50, 0, 1.9], [50, 0, 2.1]]), tree, rgb)
    weight = 1.0 / (0.2 + np.array([0.0, 1.0, 1.9]))
    assert seen[0, 0] == pytest.approx(((weight * [0.2, 0.4, 0.8]).sum() / weight.sum()) ** 2) and seen[0, 1] == 0.0
    assert known.tolist() == [True, False, True, False]
    np.testing.assert_allclose(seen[2], [0.0, 1.0, 0.0])
    many = cKDTree(0.01 * np.arange(8)[:, None] * [1.0, 0, 0])
    seen, _ = colours._looked_up(np.zeros((1, 3)), many, np.repeat([[0.5], [1.0]], [6, 2], axis=0) * np.ones(3))
    np.testing.assert_allclose(seen, 0.25)


@pytest.mark.parametrize(("forward", "count", "told"), [(0.31, 20, True), (0.29, 20, False), (0.31, 19, False)])
def test_the_skins_colour_is_the_median_of_twenty_places_that_look_forward(forward, count, told):
    normals = np.tile([0.0, 0.0, forward], (count + 5, 1))
    seen = np.tile([0.3, 0.001, 0.95], (count + 5, 1))
    seen[: count // 3] = 0.0
    known = np.arange(count + 5) < count
    found = colours._front_colour(SimpleNamespace(normals=normals), seen, known)
    assert (found is not None) == told
    if told:
        np.testing.assert_allclose(found, [0.3, 0.015, 0.85])  # as bright as skin can be


def test_saturation_is_that_of_what_the_eye_sees():
    assert colours._saturation(np.array([0.25, 0.04, 0.09])) == pytest.approx(0.6)
    assert colours._saturation(np.full(3, 0.3)) == 0.0 and colours._saturation(np.zeros(3)) == 1.0
    assert colours._words(np.array([0.123, 0.5, 1.0])) == "0.12 0.50 1.00"
    layer = colours._all_over("a", "iris", np.array([0.123456, 0.5, 1.0]))
    assert layer == {"part": "a", "attribute": "iris", "kind": "all", "value": [0.1235, 0.5, 1.0]}
    assert colours._is_base({"part": "a", "attribute": "albedo", "kind": "all"}, "a")
    for key, value in (("part", "b"), ("attribute", "gloss"), ("kind", "band")):
        assert not colours._is_base({"part": "a", "attribute": "albedo", "kind": "all", key: value}, "a")


@pytest.mark.parametrize(("low", "high", "told"), [(0.5, 0.529, False), (0.45, 0.56, True)])
def test_colours_that_hardly_differ_say_nothing(low, high, told):
    rows = np.repeat(np.linspace(low, high, 3), 3)[:, None] * np.ones(3)
    assert (scan_colours(quads(rows)) is not None) == told
    assert scan_colours(quads(rows * [1.0, 0.95, 0.95])) is not None  # but for a tint
