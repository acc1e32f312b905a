"""What lines the mouth stays behind the skin, also where shapes move the skin back."""

from dataclasses import replace

import numpy as np
import pytest
from small_head import all_points, part, small_head

from surface.fit.transfer import lining as module
from surface.fit.transfer.lining import BEHIND_MM, keep_lining_behind
from surface.head import Contact, Head, HeadData

BACK = {"jawOpen": 1.0, "mouthClose": 1.0}


def head(depth: float = 3.0, chin: float = 4.0, followers: tuple[str, ...] = ("lining",)) -> HeadData:
    """A sheet of skin whose upper part goes back by ``chin`` mm with mouthClose, and a lining ``depth`` mm behind."""
    skin = part("skin", -20.0)
    high = np.flatnonzero(skin.knots_v[:, 1:4].mean(axis=1) > 0.5).astype(np.int32)
    close = all_points("mouthClose", (0.0, 0.0, -chin))
    skin = replace(skin, groups=[replace(close, ids=high, moves=close.moves[high])])
    lining = part("lining", -20.0)
    lining = replace(lining, material="mouth", points=lining.points - [0.0, 0.0, depth])
    rows = np.linspace(0.0, 0.02, 6)
    places = np.stack([np.stack(np.meshgrid(np.linspace(0.1, 0.9, 7), 0.02 + s * rows, indexing="ij"), axis=-1)
                       for s in (1, -1)])  # fmt: skip
    lips = Contact("lips", "skin", followers, -1, 0.5, 0.5, np.clip(places, 0.0, 1.0))
    return replace(small_head(), parts=[skin, lining], seams=[], paint=[], contacts=[lips])


def lack(data: HeadData) -> float:
    """How far the lining is before where it shall be, at most, in the worst pose."""
    posed = Head(data)
    posed.pose(posed.values(BACK))
    return float(module._lack(posed, "skin", posed.part("lining")).max())


def test_a_lining_that_comes_through_the_skin_is_moved_back() -> None:
    before = head()
    points = before.parts[1].points.copy()
    assert 4.0 - 3.0 + BEHIND_MM - 0.3 < lack(before) < 4.0 - 3.0 + BEHIND_MM + 0.3
    after, (note,) = keep_lining_behind(before)
    assert lack(after) == 0.0
    np.testing.assert_array_equal(before.parts[1].points, points)  # what was given stays as it was
    moves = after.parts[1].points - points
    assert not moves[:, :2].any() and moves[:, 2].max() == 0.0  # straight back only
    assert 1.5 < -moves[:, 2].min() < 6.0 and f"{-moves[:, 2].min():.1f} mm" in note
    low = np.flatnonzero(before.parts[1].knots_v[:, 1:4].mean(axis=1) == 0.0)
    assert not moves[low].any()  # nothing comes out there
    np.testing.assert_array_equal(after.parts[0].points, before.parts[0].points)


@pytest.mark.parametrize(("moved", "told"), [(0.04, []), (0.06, ["0.1 mm"])])
def test_no_remark_says_that_the_lining_was_moved_by_nothing(
    monkeypatch: pytest.MonkeyPatch, moved: float, told: list[str]
) -> None:
    monkeypatch.setattr(module, "_moved_back", lambda _posed, _lips, lining: lining.rig.rest - [0.0, 0.0, moved])
    before = head()
    after, notes = keep_lining_behind(before)
    np.testing.assert_allclose(before.parts[1].points[:, 2] - after.parts[1].points[:, 2], moved)
    assert len(notes) == len(told) and all(word in note for word, note in zip(told, notes, strict=True))


def test_what_stays_behind_in_every_pose_is_left_alone() -> None:
    fine = head(depth=7.0)
    assert keep_lining_behind(fine) == (fine, [])


def test_only_what_follows_the_lips_is_a_lining() -> None:
    other = head(followers=())
    assert keep_lining_behind(other) == (other, [])
    without = replace(head(), contacts=[])
    assert keep_lining_behind(without) == (without, [])


def test_what_is_far_before_the_skin_has_nothing_to_do_with_it() -> None:
    far = head(depth=-module.MAX_BEFORE_MM - 2.0)
    assert keep_lining_behind(far) == (far, [])
