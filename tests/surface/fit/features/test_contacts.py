"""Where lips and lids can meet, found on the shipped face."""

import numpy as np
import pytest

from surface.fit.features.contacts import COLUMNS, FADE_ROWS, ROWS, find_contacts, sample_places
from surface.head.model.file import load_data
from surface.head.model.meshes import make_surface


@pytest.fixture(scope="module")
def data(root):
    return load_data(root / "configs" / "heads" / "ict")


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
