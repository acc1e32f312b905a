"""Blinks that are lengthened or shortened, column by column, until lids leave no more open than before."""

from dataclasses import replace

import numpy as np
import pytest
from small_head import part, small_head

from surface.fit.transfer import lids as module
from surface.fit.transfer.lids import close_lids
from surface.head import Contact, Group, HeadData


def head(move: float, radius: float = 12.0, names=("left_lids", "eyeBlinkLeft")) -> HeadData:
    """A sheet whose upper half comes down by ``move`` mm in a blink; rows of lids lie above and below v = 0.5."""
    face = part("a", -20.0)
    upper = np.flatnonzero(face.knots_v[:, 1:4].mean(axis=1) > 0.5).astype(np.int32)
    moves = np.tile(np.array([[0.0, -move, 0.0]], np.float32), (len(upper), 1))
    other = Group("jawOpen", upper, moves.copy())
    u, rows = np.linspace(0.1, 0.9, 7), np.linspace(0.0, 0.06, 6)
    places = np.stack([np.stack(np.meshgrid(u, 0.5 + s * (0.12 + rows), indexing="ij"), axis=-1) for s in (1, -1)])
    contact = Contact(names[0], "a", (), 0, 2.0, 0.5, places)
    face = replace(face, groups=[Group(names[1], upper, moves), other], lids=np.zeros(25))
    return replace(small_head(), parts=[face], seams=[], paint=[], contacts=[contact], eye_radius=radius,
                   eyes=np.array([[900.0, 0, 0], [-900.0, 0, 0]]))  # fmt: skip


def gap(made: HeadData, value: float = 1.0, shape: str = "eyeBlinkLeft") -> np.ndarray:
    (contact,) = made.contacts
    return module._gap(made, contact, module._edges(made, contact), shape, value)[1]


def test_the_gap_is_between_the_lowest_place_of_one_lid_and_the_highest_of_the_other() -> None:
    made = head(3.0)
    (contact,) = made.contacts
    surface = module.make_surface(made.parts[0])
    at = surface.evaluate(contact.places.reshape(-1, 2)).reshape(2, 7, 6, 3)
    x, rest = module._gap(made, contact, module._edges(made, contact), "eyeBlinkLeft", 0.0)
    np.testing.assert_allclose(rest, at[0, :, 0, 1] - at[1, :, 0, 1], atol=1e-9)
    np.testing.assert_allclose(x, at[:, :, 0, 0].mean(axis=0), atol=1e-9)


@pytest.mark.parametrize("share", [0.5, 1.0, 1.4])
def test_a_blink_is_changed_by_a_share_at_each_place(share: float) -> None:
    made = head(2.0)
    x = np.array([20.0, -20.0, 0.0])
    other = module._with_share(made, "eyeBlinkLeft", x, np.array([share, 0.0, 0.5 * share]))
    (blink, jaw), (old, _) = other.parts[0].groups, made.parts[0].groups
    at = other.parts[0].points[blink.ids, 0]
    wanted = old.moves * (1.0 + share * np.clip((at + 20) / 40, 0, 1))[:, None]
    np.testing.assert_allclose(blink.moves, wanted, atol=1e-5)
    np.testing.assert_array_equal(jaw.moves, made.parts[0].groups[1].moves)


@pytest.mark.parametrize("move", [4.0, 6.0, 7.0])
def test_a_blink_that_leaves_more_open_than_the_source_is_lengthened(move: float) -> None:
    source, wanted = head(7.5), gap(head(7.5))
    made = close_lids(head(move), source)
    left = gap(made) - wanted
    assert left.max() < 0.25 * (gap(head(move)) - wanted).max() and left.min() > -0.5
    np.testing.assert_array_equal(made.parts[0].points, head(move).parts[0].points)


def test_a_blink_that_leaves_less_open_stays_as_it_is() -> None:
    made = close_lids(head(9.0), head(7.5))
    np.testing.assert_array_equal(made.parts[0].groups[0].moves, head(9.0).parts[0].groups[0].moves)


def test_larger_eyes_may_be_left_open_by_more() -> None:
    wanted = 1.25 * gap(head(7.5))
    before = gap(head(0.9, radius=15.0))
    after = gap(close_lids(head(0.9, radius=15.0), head(7.5)))
    assert (before > wanted).all() and (after < before - 0.5 * (before - wanted)).all() and (after > wanted - 0.3).all()


def test_no_blink_is_lengthened_without_bounds_and_other_contacts_not_at_all() -> None:
    made = close_lids(head(1.0), head(9.0))
    share = made.parts[0].groups[0].moves[:, 1] / -1.0
    assert share.max() <= 2.5 + 1e-6 and share.max() > 2.0
    lips = head(3.0, names=("lips", "mouthClose"))
    assert close_lids(lips, lips) is lips
