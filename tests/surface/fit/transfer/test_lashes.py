"""Lashes move with the lid they grow from, as on the head that the expressions come from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from surface.fit.transfer.lashes import MATERIAL, _roots, moves_of, rooted_lashes
from surface.head import Group, Head, HeadData, PartData

BLINK = "eyeBlinkLeft"
ICT = Path(__file__).resolve().parents[4] / "configs" / "heads" / "ict"


@pytest.fixture(scope="module")
def source() -> Head:
    return Head.load(ICT)


def lashes_of(head: HeadData) -> PartData:
    return next(p for p in head.parts if p.material == MATERIAL)


def with_blink(head: HeadData, part: str, factor: float) -> HeadData:
    """The head whose blink of the left eye moves one part further."""

    def moved(p: PartData) -> PartData:
        groups = [Group(g.name, g.ids, factor * g.moves) if g.name == BLINK else g for g in p.groups]
        return replace(p, groups=groups) if p.name == part else p

    return replace(head, parts=[moved(p) for p in head.parts])


def test_lashes_of_the_same_head_move_as_before(source: Head) -> None:
    before, after = lashes_of(source.data), lashes_of(rooted_lashes(source.data, source))
    assert [g.name for g in after.groups] == [g.name for g in before.groups]
    for group in before.groups:
        np.testing.assert_allclose(moves_of(after, group.name), moves_of(before, group.name), atol=1e-4)


def test_lashes_go_as_far_as_a_lid_that_was_lengthened_and_keep_their_own_motion_beside_it(source: Head) -> None:
    before = lashes_of(source.data)
    made = lashes_of(rooted_lashes(with_blink(source.data, "face", 1.5), source))
    more = moves_of(made, BLINK) - moves_of(before, BLINK)
    upper = before.points[:, 0] > 0
    upper &= np.linalg.norm(moves_of(before, BLINK), axis=1) > 5.0
    assert upper.sum() > 10 and np.linalg.norm(more[upper], axis=1).min() > 2.0
    assert np.abs(more[before.points[:, 0] < 0]).max() < 0.2  # the other eye does not blink
    np.testing.assert_allclose(moves_of(made, "eyeBlinkRight"), moves_of(before, "eyeBlinkRight"), atol=1e-4)


def test_what_the_map_did_to_the_lashes_alone_is_taken_back_and_larger_eyes_have_larger_ones(source: Head) -> None:
    before = moves_of(lashes_of(source.data), BLINK)
    stretched = with_blink(source.data, lashes_of(source.data).name, 2.0)
    np.testing.assert_allclose(moves_of(lashes_of(rooted_lashes(stretched, source)), BLINK), before, atol=1e-4)
    larger = moves_of(
        lashes_of(rooted_lashes(replace(stretched, eye_radius=1.5 * stretched.eye_radius), source)), BLINK
    )
    lid = moves_of(lashes_of(rooted_lashes(replace(stretched, eye_radius=0.0), source)), BLINK)  # nothing beside it
    assert np.abs(before - lid).max() > 5.0
    np.testing.assert_allclose(larger - lid, 1.5 * (before - lid), atol=1e-4)


def test_a_hair_has_the_root_that_is_nearest_to_it() -> None:
    skin = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [10, 8, 0]])
    hairs = np.array([[0.0, 0, 1.0], [2.0, 0, 1.4], [0.1, 0, 5.0], [1.8, 7, 0.0]])
    assert _roots(hairs, skin).tolist() == [0, 2, 0, 2]  # the last is nearer to other skin, but not rooted there
    assert _roots(hairs[2:3], skin).tolist() == [0]  # without a root the nearest counts as one
