"""The eyeball is two exact spheres."""

import numpy as np

from surface.fit.points import eyeball
from surface.fit.points.eyeball import BACK, CORNEA, IRIS, LIMBUS, LIMBUS_V, eyeball_surface, surface_height
from surface.head.posing.contact_kernels import CORNEA_AT, CORNEA_RADIUS

CENTRE, RADIUS = np.array([31.0, 36.0, 84.0]), 12.0
S = eyeball_surface(CENTRE, RADIUS)


def samples(v0: float, v1: float) -> np.ndarray:
    uv = np.stack(np.meshgrid(np.linspace(0, 1, 37), np.linspace(v0, v1, 23)), axis=-1).reshape(-1, 2)
    return (S.evaluate(uv) - CENTRE) / RADIUS


def test_the_sclera_is_a_sphere():
    assert np.abs(np.linalg.norm(samples(LIMBUS_V, 1.0), axis=1) - 1).max() < 1e-12


def test_the_cornea_is_a_smaller_sphere_in_front():
    p = samples(0.0, LIMBUS_V)
    z = np.sqrt(1 - IRIS**2) - np.sqrt(CORNEA**2 - IRIS**2)
    assert np.abs(np.linalg.norm(p - [0, 0, z], axis=1) - CORNEA).max() < 1e-12
    assert 1.05 < p[:, 2].max() < 1.2


def test_the_limbus_is_a_circle_facing_forward():
    p = samples(LIMBUS_V, LIMBUS_V)
    assert np.abs(np.hypot(p[:, 0], p[:, 1]) - IRIS).max() < 1e-12
    assert np.ptp(p[:, 2]) < 1e-12 and p[0, 2] > 0


def test_it_reaches_far_round_the_back():
    assert np.abs(samples(1.0, 1.0)[:, 2] - np.cos(BACK)).max() < 1e-12


def test_normals_point_outwards():
    uv = np.stack(np.meshgrid(np.linspace(0.01, 0.99, 9), np.linspace(0.05, 0.95, 9)), axis=-1).reshape(-1, 2)
    p, su, sv = S.derivatives(uv)
    assert ((np.cross(su, sv) * (p - CENTRE)).sum(axis=1) > 0).all()


def test_lids_are_held_on_the_cornea_that_is_drawn():
    limbus, edge = np.arcsin(IRIS), np.arcsin(IRIS / CORNEA)
    assert CORNEA_RADIUS == CORNEA
    assert abs(CORNEA_AT - (np.cos(limbus) - CORNEA * np.cos(edge))) < 1e-4


def test_heights_lie_on_the_ball_or_on_the_corneas_own_sphere():
    rng = np.random.default_rng(2)
    directions, gaze = (rng.normal(size=(400, 3)) for _ in range(2))
    directions, gaze = (rows / np.linalg.norm(rows, axis=1, keepdims=True) for rows in (directions, gaze))
    gaze[:200] = directions[:200] + 0.2 * gaze[:200]
    gaze /= np.linalg.norm(gaze, axis=1, keepdims=True)
    places = surface_height(directions, gaze)[:, None] * directions
    on_cornea = np.abs(np.linalg.norm(places - eyeball.CORNEA_AT * gaze, axis=1) - CORNEA) < 1e-9
    on_ball = np.abs(np.linalg.norm(places, axis=1) - 1.0) < 1e-9
    ahead = (directions * gaze).sum(axis=1) > np.cos(LIMBUS)
    assert on_cornea[ahead].all() and on_ball[~ahead].all() and 100 < ahead.sum() < 300
    one = surface_height(directions, gaze[0])
    np.testing.assert_array_equal(one, surface_height(directions, np.tile(gaze[0], (400, 1))))
