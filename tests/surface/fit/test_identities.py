"""Variations out of identity modes: symmetric, as asked for, closing lids; and those that ship."""

from dataclasses import replace

import numpy as np
import pytest
from small_head import small_head

from surface.base.errors import FitError
from surface.fit.identities import Wanted, add_identities, measure, mixes, read_wanted, symmetric
from surface.head import Head
from surface.head.model.data import HeadData
from surface.head.model.file import load_data, save_data
from surface.head.model.identity import load_identities, with_identities

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
    from slit_sheet import slit_sheet, write_npz

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
