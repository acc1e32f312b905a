"""Variations out of identity modes: symmetric, as asked for, closing lids; and those that ship."""

from dataclasses import replace

import numpy as np
import pytest
from slit_sheet import slit_sheet, write_npz
from small_head import part, small_head

from surface.base.errors import FitError
from surface.fit import identities
from surface.fit.api import part_chart, recipe_plan
from surface.fit.features.pieces import HeadRig, skin_part
from surface.fit.identities import (
    ROWS,
    Wanted,
    add_identities,
    close_lids,
    fit_identities,
    measure,
    mixes,
    read_modes,
    read_wanted,
    symmetric,
)
from surface.fit.points.net import Net
from surface.fit.points.recipe import PartRecipe, Recipe
from surface.fit.points.refine import FitRequest, fit_chart
from surface.fit.points.solve import basis
from surface.head import Head
from surface.head.model.data import Group, HeadData, Jaw
from surface.head.model.file import load_data, save_data
from surface.head.model.identity import Identity, fingerprint, load_identities, with_identities
from surface.head.model.meshes import make_surface

MEASURES = {"width": {"axis": "x", "to": [0], "from": [1]}, "height": {"axis": "y", "to": [2], "from": [0, 1]}}


@pytest.fixture
def points() -> np.ndarray:
    return np.array([[10.0, 0, 0], [-10, 0, 0], [0, 20, 0], [0, 5, 8]])


def test_measures_are_distances_along_an_axis(points):
    assert measure(points, MEASURES) == {"width": 20.0, "height": 20.0}


def test_modes_become_symmetric(points):
    modes = np.random.default_rng(1).normal(size=(3, 4, 3))
    even = symmetric(points, modes)
    np.testing.assert_allclose(even[:, 0] * [-1, 1, 1], even[:, 1])
    np.testing.assert_allclose(even[:, 2:, 0], 0, atol=1e-12)


def test_the_shortest_mix_that_does_what_is_asked(points):
    rng = np.random.default_rng(2)
    modes = symmetric(points, rng.normal(size=(8, 4, 3)))
    wanted = Wanted(4, 100.0, np.arange(4), MEASURES, {"broad": {"width": 10.0, "height": -5.0}})
    (field,) = mixes(points, modes, wanted)
    changed = measure(points + field, MEASURES)
    assert changed["width"] == pytest.approx(22.0) and changed["height"] == pytest.approx(19.0)
    short = Wanted(4, 0.1, wanted.landmarks, MEASURES, wanted.identities)
    (less,) = mixes(points, modes, short)
    np.testing.assert_allclose(less / np.linalg.norm(less), field / np.linalg.norm(field))
    assert np.linalg.norm(less) < np.linalg.norm(field)


def test_the_table_asks_only_for_measures_it_has():
    wanted = read_wanted()
    assert 6 <= len(wanted.identities) <= 8 and len(wanted.landmarks) == 68
    for goals in wanted.identities.values():
        assert set(goals) <= set(wanted.measures)


def test_another_mesh_or_modes_are_refused(tmp_path):
    save_data(tmp_path / "head", small_head())
    mesh = write_npz(tmp_path / "m.npz", slit_sheet())
    with pytest.raises(FitError, match="no variations are known for this mesh"):
        add_identities(tmp_path / "head", mesh, mesh)
    assert load_identities(tmp_path / "head") == {}


@pytest.fixture(scope="module")
def heads(root) -> tuple[Head, dict[str, Head]]:
    folder = root / "configs" / "heads" / "ict"
    known, data = load_identities(folder), load_data(folder)
    return _eyes_and_face(data), {n: _eyes_and_face(with_identities(data, known, {n: 1.0}, n)) for n in known}


def _eyes_and_face(data: HeadData) -> Head:
    parts = [p for p in data.parts if p.name in ("face", "sockets", "eye_left", "eye_right")]
    contacts = [c for c in data.contacts if c.eye >= 0]
    return Head(replace(data, parts=parts, seams=[], contacts=contacts, paint=[]))


def extent(head: Head, axis: int) -> float:
    return float(np.ptp(head.part("face").vertices[:, axis]))


@pytest.mark.slow
def test_those_that_ship_differ_as_their_names_say(heads):
    base, made = heads
    assert set(made) == set(read_wanted().identities)
    eyes = {n: float(np.ptp(h.data.eyes[:, 0])) for n, h in made.items()}
    ratio = {n: (extent(h, 0) / extent(h, 1)) / (extent(base, 0) / extent(base, 1)) for n, h in made.items()}
    assert ratio["broad"] > 1.01 > 0.99 > ratio["narrow"] and ratio["short"] > ratio["long"]
    assert eyes["broad"] > eyes["narrow"]
    for head in made.values():
        face = head.part("face").vertices
        assert 1.5 < np.linalg.norm(face - base.part("face").vertices, axis=1).max() < 25


@pytest.mark.slow
def test_eyes_stay_in_their_sockets_and_lids_close(heads):
    base, made = heads
    for head in (base, *made.values()):
        for side, name in enumerate(("eye_left", "eye_right")):
            centre = head.part(name).vertices.mean(axis=0)
            assert np.abs((centre - head.data.eyes[side])[:2]).max() < 0.5
        assert max(lid_gap(head, side) for side in (0, 1)) < 0.85


def lid_gap(head: Head, side: int) -> float:
    """Height (mm) of the eyeball seen from the front in the middle of a closed eye."""
    from face_measures import eye_opening

    head.pose(head.values({"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0}))
    opening = eye_opening(head, side, 0.2)[0]
    head.pose(head.values({}))
    return opening


def test_control_points_follow_the_mesh_and_so_does_the_hinge():
    mesh = slit_sheet()
    part = PartRecipe("face", "skin", "skin", [(0, 9999)], FitRequest(300, coarse=0.2), (0, 0.5, 4))
    recipe = Recipe([part])
    ((own, islands),) = recipe_plan(mesh, recipe).parts
    chart = part_chart(mesh, own, islands)
    fit = fit_chart(mesh, chart, part.request)
    rig = HeadRig({"jawOpen": [0]}, Jaw((0.0, 6.0, 12.0), 0.2, (0.0, 0.0, 0.0)), np.zeros((2, 3)), 0.0)
    face = skin_part(own, chart, fit, rig)
    hair = replace(face, name="hair", points=face.points[::9] + np.array([0, 0, 1.0]))
    head = small_head(parts=[face, hair], seams=[], paint=[])
    x = mesh.vertices[:, :1]
    forward = np.tile([0.0, 1.0, 5.0], (len(mesh.vertices), 1))
    fields = {"forward": forward, "wide": 0.1 * x * [1.0, 0.0, 0.0]}
    made = {i.name: i for i in fit_identities(head, mesh, recipe, fields, "head")}
    assert list(made) == ["forward", "wide"] and made["wide"].fit == fingerprint(head)
    b = basis(fit.net, chart.uv)
    for name, field in fields.items():
        moves = np.zeros((len(face.points), 3))
        moves[made[name].groups["face"].ids] = made[name].groups["face"].moves
        np.testing.assert_allclose(b @ moves, chart.mix @ field, atol=0.1)
    near = np.zeros((len(hair.points), 3))
    near[made["forward"].groups["hair"].ids] = made["forward"].groups["hair"].moves
    np.testing.assert_allclose(near, np.tile([0.0, 1.0, 5.0], (len(near), 1)), atol=2e-3)
    np.testing.assert_allclose(made["forward"].jaw, [0.0, 1.0, 5.0], atol=0.05)
    assert made["wide"].jaw[0] == 0.0 and not made["wide"].eyes.any()
    with pytest.raises(FitError, match="head: part 'face' was not fitted to this mesh"):
        fit_identities(head, replace(mesh, vertices=mesh.vertices + np.array([0, 0, 0.6])), recipe, fields, "head")
    fit_identities(
        head, replace(mesh, vertices=mesh.vertices + np.array([0, 0, 0.2])), recipe, {"forward": forward}, "head"
    )


def test_modes_come_in_the_unit_of_the_mesh(tmp_path):
    mesh = slit_sheet()
    file = write_npz(tmp_path / "m.npz", replace(mesh, vertices=mesh.vertices / 10))
    deltas = np.random.default_rng(1).normal(size=(3, len(mesh.vertices), 3))
    np.savez(tmp_path / "modes.npz", deltas=deltas)
    np.testing.assert_allclose(read_modes(tmp_path / "modes.npz", mesh, file), 10 * deltas)
    broken = np.where(np.arange(3)[:, None, None] == 1, np.nan, deltas)
    cases = (
        (deltas[:, 1:], r"expected \(k, 625, 3\)"),
        (deltas[0], "deltas has shape"),
        (broken, r"deltas\[1\] holds"),
    )
    for wrong, message in cases:
        np.savez(tmp_path / "modes.npz", deltas=wrong)
        with pytest.raises(FitError, match=message):
            read_modes(tmp_path / "modes.npz", mesh, file)
    np.savez(tmp_path / "modes.npz", other=deltas)
    with pytest.raises(FitError, match=r"has no array of numbers 'deltas'") as caught:
        read_modes(tmp_path / "modes.npz", mesh, file)
    assert caught.value.hint == "give the identity modes of this mesh"


def lidded() -> HeadData:
    """Two lids on one patch that meet where the height is 0: eyeBlinkLeft moves the upper one down by 6 mm, more
    towards x = -40. The patch is 40 mm long and wide."""
    upper = np.arange(25).reshape(5, 5)[:, 3:].ravel()
    face = part("a", -40)
    down = np.zeros((len(upper), 3), np.float32)
    down[:, 1] = -6.0 + 0.05 * (face.points[upper, 0] + 20.0)
    return small_head(parts=[replace(face, groups=[Group("eyeBlinkLeft", upper.astype(np.int32), down)])])


def lid_places(columns: int = 7) -> tuple[np.ndarray, np.ndarray]:
    """(u, v) of the upper and of the lower lid: columns from left to right, and one row of samples above another."""
    u, out = np.meshgrid(np.linspace(0.2, 0.8, columns), np.linspace(0.0, 0.03, ROWS), indexing="ij")
    return np.stack([u, 0.75 + out], axis=-1), np.stack([u, 0.35 - out], axis=-1)[::-1]


def heights(head: HeadData, **pose: float) -> tuple[np.ndarray, np.ndarray]:
    face, (upper, lower) = head.parts[0], lid_places()
    net = Net(np.zeros((25, 4), np.int64), face.knots_u, face.knots_v)
    edges = basis(net, np.vstack([upper, lower]).reshape(-1, 2))
    return identities._edge_heights(head, edges, len(upper), pose)


def test_an_opening_is_as_high_as_its_upper_edge_is_above_the_lower_one_at_the_same_x() -> None:
    head = lidded()
    surface = make_surface(head.parts[0])
    upper, lower = (surface.evaluate(places.reshape(-1, 2)).reshape(7, ROWS, 3) for places in lid_places())
    x, found = heights(head)
    np.testing.assert_allclose(x, upper[:, :, 0].mean(axis=1), atol=1e-9)
    level = lower[:, :, 1].max(axis=1)[::-1], lower[:, :, 0].mean(axis=1)[::-1]
    np.testing.assert_allclose(found, upper[:, :, 1].min(axis=1) - np.interp(x, level[1], level[0]), atol=1e-9)
    shut, half = heights(head, eyeBlinkLeft=1.0)[1], heights(head, eyeBlinkLeft=0.5)[1]
    assert (found - shut > 3.0).all() and (np.diff(found - shut) < 0).all()  # further where x is less
    np.testing.assert_allclose(half, 0.5 * (found + shut), atol=1e-6)


@pytest.mark.parametrize("rise", [1.5, 3.0])
def test_lids_of_an_identity_close_as_far_as_those_of_the_head(rise: float) -> None:
    head = lidded()
    upper = head.parts[0].groups[0].ids
    shift = np.tile(np.float32([0.0, rise, 0.0]), (len(upper), 1))
    still = np.zeros((2, 3)), np.zeros(3)
    identity = Identity("high", {"a": Group("high", upper, shift)}, {}, *still, fingerprint(head))
    plain = with_identities(head, {"high": identity}, {"high": 1.0}, "")
    assert np.abs(heights(plain, eyeBlinkLeft=1.0)[1] - heights(head, eyeBlinkLeft=1.0)[1]).min() > 0.8
    lids = [lid_places(), lid_places()]
    changed = close_lids(head, identity, lids)
    closing = with_identities(head, {"high": changed}, {"high": 1.0}, "")
    off = heights(closing, eyeBlinkLeft=1.0)[1] - heights(head, eyeBlinkLeft=1.0)[1]
    assert np.abs(off).max() < 0.25
    np.testing.assert_allclose(heights(closing)[1], heights(plain)[1], atol=1e-9)  # open they are as before
    assert changed.groups is identity.groups and [g.name for g in changed.changes["a"]] == ["eyeBlinkLeft"]


def test_a_blink_is_changed_by_at_most_its_range() -> None:
    head = lidded()
    upper = head.parts[0].groups[0].ids
    for rise, share in ((20.0, 0.8), (-1.5, 0.0), (-20.0, 0.0)):  # lids that close further than before may do so
        shift = np.tile(np.float32([0.0, rise, 0.0]), (len(upper), 1))
        identity = Identity("x", {"a": Group("x", upper, shift)}, {}, np.zeros((2, 3)), np.zeros(3), fingerprint(head))
        (change,) = close_lids(head, identity, [lid_places(), lid_places()]).changes["a"]
        np.testing.assert_allclose(change.moves, share * head.parts[0].groups[0].moves, atol=2e-3)


def test_a_change_of_a_blink_follows_its_share_along_x() -> None:
    head = lidded()
    group = head.parts[0].groups[0]
    old = {"a": [Group("eyeBlinkLeft", group.ids, 9 * group.moves), Group("jawOpen", group.ids, group.moves)]}
    identity = Identity("x", {}, old, np.zeros((2, 3)), np.zeros(3), 0)
    x, share = np.array([-10.0, -35.0, -20.0]), np.array([0.3, -0.1, 0.2])
    changed = identities._with_change(head, identity, "eyeBlinkLeft", x, share)
    kept, new = changed.changes["a"]
    assert kept.name == "jawOpen" and new.name == "eyeBlinkLeft" and identity.changes is old
    at = head.parts[0].points[group.ids, 0]
    wanted = np.interp(at, [-35.0, -20.0, -10.0], [-0.1, 0.2, 0.3])[:, None] * group.moves
    np.testing.assert_allclose(new.moves, np.round(wanted, 3), atol=1e-6)
    other = identities._with_change(head, identity, "eyeBlinkRight", x, share)
    assert [g.name for g in other.changes["a"]] == ["eyeBlinkLeft", "jawOpen"]


def test_hair_and_teeth_follow_the_eight_vertices_around_them_the_nearest_most() -> None:
    rng = np.random.default_rng(3)
    points, rest, shifts = rng.normal(size=(5, 3)), rng.normal(size=(40, 3)), rng.normal(size=(2, 40, 3))
    found = identities._followed(points, rest, shifts)
    for i, point in enumerate(points):
        distance = np.linalg.norm(rest - point, axis=1)
        near = np.argsort(distance)[:8]
        share = 1.0 / (0.5 + distance[near])
        for k in range(2):
            wanted = (share[:, None] * shifts[k, near]).sum(axis=0) / share.sum()
            np.testing.assert_allclose(found[k, i], wanted)


def test_the_hinge_goes_where_what_turns_about_it_goes_but_never_aside() -> None:
    jaw = np.zeros(25)
    jaw[[3, 7]] = 1.0, 0.5
    head = small_head(parts=[part("a", -40, jaw=jaw)])
    moves = np.random.default_rng(4).normal(size=(2, 25, 3))
    found = identities._jaw_shift(head, {"a": moves})
    for k in range(2):
        wanted = (moves[k, 3] + 0.5 * moves[k, 7]) / 1.5
        assert found[k].tolist() == pytest.approx([0.0, wanted[1], wanted[2]])
    assert not identities._jaw_shift(small_head(parts=[part("a", -40)]), {"a": moves}).any()


def test_eyes_follow_their_own_shift_and_what_has_no_chart_the_mesh() -> None:
    eyes = [part(name, 0, follows=name) for name in ("left_eye", "right_eye")]
    head = small_head(parts=[*eyes, part("hair", 0)])
    shifts, eye_shifts = np.ones((1, 30, 3)), np.array([[[1.0, 2, 3], [4, 5, 6]]])
    rest = np.random.default_rng(1).normal(size=(30, 3))
    moves = identities._part_moves(head, {}, rest, shifts, eye_shifts, "head")
    assert list(moves) == ["left_eye", "right_eye", "hair"]
    np.testing.assert_array_equal(moves["left_eye"], np.tile([1.0, 2, 3], (1, 25, 1)))
    np.testing.assert_array_equal(moves["right_eye"], np.tile([4.0, 5, 6], (1, 25, 1)))
    np.testing.assert_allclose(moves["hair"], 1.0)


def test_lids_begin_at_the_edge_of_the_hole_next_to_the_eye() -> None:
    mesh = slit_sheet()
    part_ = PartRecipe("face", "skin", "skin", [(0, 9999)], FitRequest(300, coarse=0.2), (0, 0.5, 4))
    ((own, islands),) = recipe_plan(mesh, Recipe([part_])).parts
    chart = part_chart(mesh, own, islands)
    middle = mesh.vertices[chart.loop_vertices[1]].mean(axis=0)
    upper, lower = identities._rims(mesh, chart, middle + np.array([0.0, 0.0, 2.0]))
    hole = chart.loops[1]
    for lid, v, sign in ((upper, hole[:, 1].max(), 1.0), (lower, hole[:, 1].min(), -1.0)):
        on = hole[hole[:, 1] == v]
        np.testing.assert_allclose(lid[:, 0], on[np.argsort(on[:, 0])], atol=1e-12)
        rows = np.tile(sign * np.linspace(0.0, 0.03, 9), (len(lid), 1))
        np.testing.assert_allclose(lid[:, :, 1] - v, rows, atol=1e-12)
        np.testing.assert_array_equal(lid[:, :, 0], np.tile(lid[:, :1, 0], (1, 9)))


def test_what_hardly_moves_is_left_out_of_a_group() -> None:
    moves = np.array([[0.0, 0.0101, 0], [0.0, 0.0099, 0], [0, 0, 0], [1.23456, -2, 0.0004]])
    group = identities._group("broad", moves)
    assert group.name == "broad" and group.ids.tolist() == [0, 3]
    np.testing.assert_allclose(group.moves, [[0, 0.01, 0], [1.235, -2, 0]], atol=1e-7)


def test_a_mix_is_as_long_as_allowed_and_no_longer(points):
    modes = symmetric(points, np.random.default_rng(2).normal(size=(8, 4, 3)))

    def mixed(longest: float) -> np.ndarray:
        wanted = Wanted(4, longest, np.arange(4), MEASURES, {"broad": {"width": 10.0, "height": -5.0}})
        return mixes(points, modes, wanted)[0]

    amounts = np.linalg.lstsq(modes.reshape(8, -1).T, mixed(100.0).ravel(), rcond=None)[0]
    least = np.linalg.norm(amounts)
    np.testing.assert_allclose(mixed(0.5 * least), 0.5 * mixed(100.0), atol=1e-9)
    np.testing.assert_allclose(mixed(1.01 * least), mixed(100.0), atol=1e-9)
    # of all mixes that do what is asked, this one is the shortest: it is at right angles to those that change nothing
    effect = np.array([list(measure(mode, MEASURES).values()) for mode in modes])
    nothing = np.linalg.svd(effect.T)[2][2:]
    np.testing.assert_allclose(nothing @ amounts, 0.0, atol=1e-8)


@pytest.mark.parametrize("modes", [np.zeros((3, 4, 3)), np.zeros((0, 4, 3))])
def test_modes_that_change_nothing_of_what_is_asked_are_refused(points, modes):
    wanted = Wanted(4, 100.0, np.arange(4), MEASURES, {"broad": {"width": 10.0}})
    with pytest.raises(FitError, match="identity broad: the modes change none of width"):
        mixes(points, modes, wanted)
