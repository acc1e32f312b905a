"""surface.fit.features.worn_limits: what a head cannot hold is cut, joined or left out, and said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cards import card

from surface.fit.features import worn_limits
from surface.fit.features.worn_limits import within_limits
from surface.head.model.accessories import Accessory, read_accessories, write_accessories


def corners(accessories: tuple[Accessory, ...]) -> np.ndarray:
    """(t, 3, 3) corners of all triangles, in order."""
    found = np.concatenate([one.vertices[one.triangles] for one in accessories])
    return found[np.lexsort(found.reshape(-1, 9).T)]


def test_what_a_head_can_hold_stays_as_it_is() -> None:
    found = [card(), replace(card(), name="b")]
    limited = within_limits(found)
    assert [one.name for one in limited.accessories] == ["Card", "b"]
    assert all(one.triangles is other.triangles for one, other in zip(limited.accessories, found, strict=True))
    assert limited.notes == limited.gone == []


def test_very_many_pieces_are_joined_where_they_look_alike(tmp_path: Path) -> None:
    found = [card(z=float(k), name=f"Hair.{k}", kind=("hair", "hat")[k % 2]) for k in range(300)]
    limited = within_limits(found)
    assert [one.kind for one in limited.accessories] == ["hair", "hat"]
    np.testing.assert_array_equal(corners(limited.accessories), corners(tuple(found)))
    assert limited.notes == ["pieces of the same look are joined, 256 accessories are the most"] and limited.gone == []
    write_accessories(tmp_path, limited.accessories)
    assert len(read_accessories(tmp_path)) == 2


def test_a_texture_that_ends_at_its_edge_is_not_joined_with_one_that_repeats(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worn_limits, "MAX_ACCESSORIES", 2)
    found = [card(), card(), replace(card(), uv=card().uv + np.float32(0.5))]
    assert [one.repeats for one in within_limits(found).accessories] == [False, True]


def test_those_beyond_the_most_that_look_different_are_left_out() -> None:
    found = [replace(card(), name=f"Hat.{k}", colour=(k / 300.0, 0.0, 0.0, 1.0)) for k in range(258)]
    limited = within_limits(found)
    assert len(limited.accessories) == 256 and limited.gone == ["Hat.256", "Hat.257"]
    assert limited.notes == ["left out, 256 accessories are the most: 'Hat.256', 'Hat.257'"]


@pytest.mark.parametrize("limit", ["MAX_VERTICES", "MAX_TRIANGLES"])
def test_a_large_one_is_cut_and_its_pieces_are_not_joined_again(limit: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worn_limits, "MAX_VERTICES", 3)
    monkeypatch.setattr(worn_limits, limit, 3 if limit == "MAX_VERTICES" else 1)
    monkeypatch.setattr(worn_limits, "MAX_ACCESSORIES", 1)
    limited = within_limits([card()])
    assert [len(one.vertices) for one in limited.accessories] == [3] and len(limited.notes) == 1
    monkeypatch.setattr(worn_limits, "MAX_ACCESSORIES", 2)
    limited = within_limits([card()])
    np.testing.assert_array_equal(corners(limited.accessories), corners((card(),)))
    assert limited.gone == [] and all(len(one.triangles) == 1 for one in limited.accessories)


def test_long_names_are_cut() -> None:
    limited = within_limits([replace(card(), name=300 * "a")])
    (one,) = limited.accessories
    assert (
        one.name == 255 * "a" + "…" and limited.gone == [] and limited.notes[0].startswith("names cut to 256 letters")
    )


def test_what_lies_out_of_space_is_left_out_with_its_name() -> None:
    far = replace(card(), name="Far", vertices=np.full((4, 3), 1e6, np.float32))
    limited = within_limits([far, card()])
    assert [one.name for one in limited.accessories] == ["Card"] and limited.gone == ["Far"]
    assert "'Far': 0/vertices" in limited.notes[0]
