"""Variations out of identity modes: symmetric, as asked for, closing lids; and those that ship."""

from dataclasses import replace

import numpy as np
import pytest
from slit_sheet import slit_sheet, write_npz
from small_head import small_head

from surface.base.errors import FitError
from surface.fit.api import part_chart, recipe_plan
from surface.fit.features.pieces import HeadRig, skin_part
from surface.fit.identities import (
    Wanted,
    add_identities,
    fit_identities,
    measure,
    mixes,
    read_modes,
    read_wanted,
    symmetric,
)
from surface.fit.points.recipe import PartRecipe, Recipe
from surface.fit.points.refine import FitRequest, fit_chart
from surface.fit.points.solve import basis
from surface.head import Head
from surface.head.model.data import HeadData, Jaw
from surface.head.model.file import load_data, save_data
from surface.head.model.identity import fingerprint, load_identities, with_identities

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
