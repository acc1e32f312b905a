"""Rims of the eyes' openings, as they are seen."""

from dataclasses import replace

import numpy as np
import pytest
from part_mesh import part_mesh, shipped

from surface.fit.filling.rims import Rims, find_rims, rims_of_head, rims_of_mesh
from surface.fit.transfer.template import make_template


@pytest.fixture(scope="module")
def rims() -> Rims:
    found = rims_of_head(shipped().head)
    assert found is not None
    return found


def test_the_rims_of_a_head_are_those_of_its_lids(rims):
    known = make_template(shipped().head, "ict").landmarks
    assert len(rims.corners()) == 4
    for name, place in rims.corners().items():
        assert np.linalg.norm(place[:2] - known[name][:2]) < 1.6, name
    assert (rims.places[:, 0, 5:-5, 1] > rims.places[:, 1, 5:-5, 1] + 3.0).all()
    assert (rims.places[0, :, 0, 0] < rims.places[0, :, -1, 0]).all()
    assert (rims.places[1, :, 0, 0] > rims.places[1, :, -1, 0]).all()


def test_a_mesh_has_the_same_ones_by_the_names_of_its_pieces(rims):
    mesh, _ = part_mesh(off=np.zeros(3))
    found = rims_of_mesh(mesh)
    assert found is not None
    np.testing.assert_allclose(found.places[..., :2], rims.places[..., :2], atol=0.7)
    unnamed = replace(mesh, pieces=tuple(f"object{k}" for k in range(len(mesh.pieces))))
    assert rims_of_mesh(unnamed) is None


def test_shut_eyes_have_none():
    shut = shipped().posed({"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0})
    parts = list(zip(shipped().parts, shut, strict=True))
    skin = [(at, p.triangles) for p, at in parts if p.material == "skin"]
    eyes = [(at, p.triangles) for p, at in parts if p.material == "eye"]
    assert find_rims(skin, eyes) is None


def test_what_is_near_goes_with_the_rims_and_what_is_far_stays(rims):
    other = Rims(rims.places + np.array([1.0, -2.0, 0.5]))
    np.testing.assert_allclose(rims.moved_to(other, rims.places[0, 0]), other.places[0, 0], atol=1e-6)
    far = np.array([[0.0, -40.0, 110.0], [0.0, 100.0, 90.0]])
    np.testing.assert_allclose(rims.moved_to(other, far), far)
