"""Eyeballs, jaw, teeth and neck after a map: what moves about them moves as before, in the new place and size."""

from dataclasses import replace
from types import SimpleNamespace

import made_face
import numpy as np
import pytest
from small_head import small_head

from surface.fit.transfer.place_parts import (
    ScaleShift,
    behind_skin,
    fit_scale_shift,
    place_eyes,
    place_jaw,
    place_neck,
    place_teeth,
    scaled,
)
from surface.head import Contact, HeadData
from surface.head.posing.rig import jaw_path

SCALE, SHIFT = 1.25, np.array([3.0, -7.0, 11.0])
POINTS = np.random.default_rng(0).normal(size=(50, 3)) * 20


def enlarged(p: np.ndarray) -> np.ndarray:
    return SCALE * p + SHIFT


def data(**other) -> HeadData:
    """A small head whose skin follows the jaw below y = 0, with a bent neck and a contact."""
    made = small_head(**other)
    parts = [replace(p, jaw=(p.points[:, 1] < 0).astype(float)) if p.name == "a" else p for p in made.parts]
    lips = Contact("lips", "a", (), -1, 6.0, 0.5, np.zeros((2, 3, 3, 2)))
    neck = replace(made.neck, slope=0.4, still=-20.0, whole=-60.0)
    return replace(made, parts=parts, neck=neck, contacts=[lips])


def test_a_placing_is_the_best_uniform_scale_and_shift() -> None:
    goals = enlarged(POINTS)
    found = fit_scale_shift(POINTS, goals)
    assert found.scale == pytest.approx(SCALE)
    np.testing.assert_allclose(found.points(POINTS[:4]), goals[:4])
    weight = np.ones(50)
    weight[:5] = 0.0
    goals[:5] = 99.0
    np.testing.assert_allclose(fit_scale_shift(POINTS, goals, weight).shift, SHIFT)
    noisy = goals + np.random.default_rng(1).normal(size=(50, 3))
    best = fit_scale_shift(POINTS, noisy)
    x = np.linalg.lstsq(np.column_stack([POINTS.ravel(), *(np.tile(e, 50) for e in np.eye(3))]), noisy.ravel())[0]
    np.testing.assert_allclose([best.scale, *best.shift], x)
    alone = fit_scale_shift(np.zeros((1, 3)), np.ones((1, 3)))
    np.testing.assert_allclose(alone.points(np.zeros(3)), [1, 1, 1])


def test_eyes_go_with_the_lids_around_them_and_touch_their_fronts() -> None:
    face = made_face.template(2.0)
    centres, radius = place_eyes(face, enlarged)
    np.testing.assert_allclose(centres[:, :2], enlarged(face.eyes)[:, :2])
    assert radius == pytest.approx(SCALE * face.radius)

    def moved(p):
        return p + np.where(p[:, :1] > 0, [[0.0, 4.0, 5.0]], [[1.0, 0.0, 0.0]])

    centres, radius = place_eyes(face, moved)
    np.testing.assert_allclose(centres - face.eyes, [[0, 4, 5], [1, 0, 0]], atol=1e-9)
    assert radius == pytest.approx(face.radius)

    def ring(p):  # only the lids around the left eye become larger
        away = np.linalg.norm(p - face.eyes[0], axis=1)
        return np.where(((away > 13) & (away < 19))[:, None], face.eyes[0] + 1.3 * (p - face.eyes[0]), p)

    assert place_eyes(face, ring)[1] > 1.02 * face.radius
    assert place_eyes(face, lambda p: np.where((p[:, :1] > 0) & (p[:, 1:2] < 0), 2.0 * p, p))[1] == pytest.approx(
        face.radius
    )
    deeper = replace(face, points=face.points - np.where(face.eye[:, None] == 0, [[0, 0, 2.0]], [[0, 0, 0.0]]))

    def push(p):  # the front of the left eye only, in the middle
        return p + [0.0, 0.0, 2.0] * (np.hypot(p[:, 0] - 33, p[:, 1] - 36) < 9)[:, None]

    front = deeper.points[deeper.eye == 0]
    mean = float((push(front) - front)[:, 2].mean())
    assert place_eyes(deeper, push)[0][0, 2] - face.eyes[0, 2] == pytest.approx(mean, abs=0.1)


def test_teeth_move_as_one_by_the_map_around_them() -> None:
    def head(*materials):
        return SimpleNamespace(
            parts=[SimpleNamespace(material=m, vertices=POINTS + 40 * k) for k, m in enumerate(materials)]
        )

    def local(p):  # a different map for each part
        return (1.0 + 0.1 * (p.mean(axis=0) > 20).any()) * p

    assert place_teeth(head("skin", "teeth"), enlarged).scale == pytest.approx(SCALE)
    far = place_teeth(head("skin", "mouth"), lambda p: p * (1.5 if p[:, 0].mean() > 20 else 1.0))
    assert far.scale == pytest.approx(1.5)
    assert place_teeth(
        head("skin", "hair"), lambda p: p * (1.5 if p[:, 0].mean() > 20 else 1.0)
    ).scale == pytest.approx(1)
    only = place_teeth(head("mouth", "gums"), lambda p: p * (1.5 if p[:, 0].mean() > 20 else 1.0))
    assert only.scale == pytest.approx(1.5) and local(POINTS).shape == POINTS.shape


def check_jaw(before, after, scale, shift) -> None:
    """A point follows the jaw after a map as its image before it."""
    for value in (0.0, 0.3, 1.0):
        turn, move = jaw_path(before, value)
        turned, moved = jaw_path(after, value)
        went = scale * (POINTS @ turn.T + move) + shift
        np.testing.assert_allclose((scale * POINTS + shift) @ turned.T + moved, went, atol=1e-6)
    for name, tilt in before.tilts.items():
        push = scale * (POINTS @ np.asarray(tilt)[:, :3].T + np.asarray(tilt)[:, 3])
        other = np.asarray(after.tilts[name])
        np.testing.assert_allclose((scale * POINTS + shift) @ other[:, :3].T + other[:, 3], push, atol=1e-6)


def check_neck(before, after, scale, shift) -> None:
    def share(neck, p):
        return (p[:, 1] + neck.slope * p[:, 2] - neck.still) / (neck.whole - neck.still)

    np.testing.assert_allclose(share(after, scale * POINTS + shift), share(before, POINTS), atol=1e-9)
    np.testing.assert_allclose(after.pivot, scale * np.array(before.pivot) + shift)
    assert after.slope == before.slope


@pytest.fixture
def tilted() -> HeadData:
    made = data()
    tilts = {"jawForward": np.random.default_rng(5).normal(size=(3, 4))}
    return replace(made, jaw=replace(made.jaw, centre=(1.0, 5.0, -9.0), tilts=tilts))


def test_jaw_and_neck_go_with_a_map_of_all(tilted) -> None:
    check_jaw(tilted.jaw, place_jaw(tilted, enlarged), SCALE, SHIFT)
    assert place_jaw(tilted, enlarged).angle_rad == tilted.jaw.angle_rad
    check_neck(tilted.neck, place_neck(tilted, made_face.template(), enlarged), SCALE, SHIFT)


def test_the_jaw_goes_with_the_skin_that_follows_it_most(tilted) -> None:
    def lower(p):  # what follows the jaw is moved down, all else is not
        return p - [0.0, 6.0, 0.0] * (p[:, 1:2] < 0)

    other = replace(
        tilted, parts=[p for p in tilted.parts if p.name != "a"][::-1] + [p for p in tilted.parts if p.name == "a"]
    )
    for made in (tilted, other):
        np.testing.assert_allclose(place_jaw(made, lower).centre, np.array(made.jaw.centre) - [0, 6, 0], atol=1e-3)


def test_a_scaled_head_is_larger_in_everything_but_its_budget(tilted) -> None:
    factor, middle = 1.4, np.array([2.0, -3.0, 4.0])
    made, shift = scaled(tilted, factor, middle), (1 - factor) * middle
    check_jaw(tilted.jaw, made.jaw, factor, shift)
    check_neck(tilted.neck, made.neck, factor, shift)
    for before, after in zip(tilted.parts, made.parts, strict=True):
        np.testing.assert_allclose(after.points, factor * before.points + shift)
        for old, new in zip(before.groups, after.groups, strict=True):
            np.testing.assert_allclose(new.moves, factor * old.moves, rtol=1e-6)
            assert new.moves.dtype == np.float32 and new.name == old.name and (new.ids == old.ids).all()
        assert after.budget == before.budget if hasattr(before, "budget") else True
    np.testing.assert_allclose(made.eyes, factor * tilted.eyes + shift)
    assert made.eye_radius == pytest.approx(factor * tilted.eye_radius)
    assert [c.reach_mm for c in made.contacts] == [pytest.approx(6.0 * factor)]
    np.testing.assert_allclose(scaled(tilted, 1.0, middle).parts[0].points, tilted.parts[0].points)


def arch(x: np.ndarray, front: float) -> np.ndarray:
    """(n, 3) places of an arch, its foremost at ``front``, whatever the height."""
    return np.column_stack([x.ravel(), np.tile([-1.0, 0.0, 1.0], x.size)[: x.size], front - 0.02 * x.ravel() ** 2])


def test_teeth_go_back_as_deep_behind_the_skin_as_they_were() -> None:
    """Lips that a scan's detail brings back by 3 mm had the teeth in front of them at their corners."""
    teeth, lips = arch(np.linspace(-20, 20, 41), 90.0), arch(np.linspace(-28, 28, 113), 96.0)
    place = ScaleShift(0.9, np.array([1.0, 2.0, 3.0]))
    after = place.points(lips)
    np.testing.assert_allclose(behind_skin(place, teeth, lips, after).shift, place.shift, atol=1e-9)
    pressed = behind_skin(place, teeth, lips, after - [0.0, 0.0, 3.0])
    np.testing.assert_allclose(pressed.shift, place.shift - [0.0, 0.0, 3.0], atol=1e-9)
    assert pressed.scale == place.scale
    thick = behind_skin(place, teeth, lips, after - [0.0, 0.0, -3.0])  # they may lie deeper
    np.testing.assert_allclose(thick.shift, place.shift, atol=1e-9)
    bumpy = after - [0.0, 0.0, 3.0] + np.outer(np.abs(after[:, 0]) < 2.0, [0.0, 0.0, 8.0])
    np.testing.assert_allclose(behind_skin(place, teeth, lips, bumpy).shift, pressed.shift, atol=0.2)


def test_teeth_stay_where_no_skin_lies_before_them() -> None:
    teeth, aside = arch(np.linspace(-20, 20, 41), 90.0), arch(np.linspace(60, 80, 20), 96.0)
    place = ScaleShift(0.9, SHIFT)
    np.testing.assert_array_equal(behind_skin(place, teeth, aside, aside).shift, SHIFT)
