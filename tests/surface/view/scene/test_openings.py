"""surface.view.scene.openings"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ball_head import EYES, BallHead, BallPart, rotation, skin, values

from surface.head import Head
from surface.view.scene.openings import Openings, fit_sphere


@pytest.fixture
def head() -> BallHead:
    return BallHead()


def part(head: BallHead, name: str) -> BallPart:
    return next(p for p in head.parts if p.name == name)


@pytest.mark.parametrize("name", EYES)
def test_an_eyes_rotation_is_read_back(head: BallHead, name: str) -> None:
    openings = Openings(head.parts)
    head.pose(values(leftEyeYaw=0.6, rightEyeYaw=-0.4, headYaw=0.5))
    own = 0.6 if name == "left_eye" else -0.4
    wanted = rotation(np.radians(60 * 0.5)) @ rotation(np.radians(35 * own))
    assert openings.eye(part(head, name))["eye_rotation"] == pytest.approx(wanted, abs=1e-5)


def test_eye_local_given_by_the_head_is_used(head: BallHead) -> None:
    eye = part(head, "left_eye")
    local = np.roll((eye.rest - EYES["left_eye"]) / 13.0, 1, axis=1).astype(np.float32)
    eye.attributes["eye_local"] = local
    assert Openings(head.parts).local(eye) == pytest.approx(local)


def test_lids_follow_a_blink(head: BallHead) -> None:
    openings = Openings(head.parts)
    rest = openings.eye(part(head, "left_eye"))
    assert rest["lids"] == 1.0
    assert np.mean(rest["lid_upper"][:, 1]) > np.mean(rest["lid_lower"][:, 1]) + 5
    head.pose(values(eyeBlinkLeft=1.0))
    shut = openings.eye(part(head, "left_eye"))
    assert np.mean(shut["lid_upper"][:, 1]) < np.mean(rest["lid_upper"][:, 1]) - 5


def test_the_mouth_opens_monotonously(head: BallHead) -> None:
    openings = Openings(head.parts)
    areas = []
    for amount in (0.0, 0.3, 0.7, 1.0):
        head.pose(values(jawOpen=amount))
        openings.refresh()
        mouth = openings.mouth()
        areas.append(np.linalg.norm(mouth["opening_area"]))
        assert abs(mouth["opening_centre"][0]) < 3
    assert (np.diff(areas) > 50).all()


def test_heads_without_holes_or_skin_still_work(head: BallHead) -> None:
    closed = skin()
    eye = part(head, "left_eye")
    for parts in ([eye], [eye, part(head, "teeth")]):
        openings = Openings(parts)
        assert openings.eye(eye)["lids"] == 0.0
        assert np.linalg.norm(openings.mouth()["opening_area"]) > 0
    assert np.linalg.norm(Openings([closed]).mouth()["opening_area"]) > 0


def test_fit_sphere_is_exact_on_a_cap() -> None:
    random = np.random.default_rng(1)
    unit = random.standard_normal((60, 3)) * [1, 1, 0.2] + [0, 0, 1]
    points = 12.0 * unit / np.linalg.norm(unit, axis=1, keepdims=True) + [30.9, 36.1, 79.9]
    centre, radius = fit_sphere(points)
    assert centre == pytest.approx([30.9, 36.1, 79.9])
    assert radius == pytest.approx(12.0)


@pytest.fixture(scope="module")
def shipped(root: Path) -> Head:
    return Head.load(root / "configs" / "heads" / "ict")


def posed(head: Head, **given: float) -> Head:
    head.pose(head.values(given))
    return head


def test_the_shipped_heads_lids_are_found_and_close(shipped: Head) -> None:
    openings = Openings(posed(shipped).parts)
    for part in (p for p in shipped.parts if p.material == "eye"):
        posed(shipped)
        opened = openings.eye(part)
        assert opened["lids"] == 1.0
        posed(shipped, eyeBlinkLeft=1.0, eyeBlinkRight=1.0)
        shut = openings.eye(part)
        heights = [np.max(lids["lid_upper"][:, 1] - lids["lid_lower"][:, 1]) for lids in (opened, shut)]
        assert heights[0] > 7.0
        assert heights[1] < 0.35 * heights[0]


def test_the_shipped_heads_mouth_lets_in_more_light_when_open(shipped: Head) -> None:
    openings = Openings(posed(shipped).parts)
    areas = []
    for amount in (0.0, 0.25, 0.5, 1.0):
        posed(shipped, jawOpen=amount)
        openings.refresh()
        areas.append(np.linalg.norm(openings.mouth()["opening_area"]))
    assert (np.diff(areas) > 60).all()


def test_the_shipped_heads_eyes_turn_by_their_parameters(shipped: Head) -> None:
    openings = Openings(posed(shipped).parts)
    for part in (p for p in shipped.parts if p.material == "eye"):
        posed(shipped, leftEyeYaw=0.5, rightEyeYaw=0.5)
        assert openings.eye(part)["eye_rotation"] == pytest.approx(rotation(np.radians(17.5)), abs=1e-3)
