"""surface.view.pictures.outside: sides that nobody can see are found, and the picture stays without them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cards import card
from small_head import small_head

from surface.head import Head, save_data
from surface.head.model.accessories import Accessory, read_accessories, write_accessories
from surface.head.model.data import Neck
from surface.head.posing.dressing import WornMesh
from surface.view import Camera, Offscreen
from surface.view.pictures import outside
from surface.view.pictures.outside import find_outside, with_outside

TURNS = Neck((0.0, 0.0, 0.0), 0.0, -900.0, -800.0)  # all of a head turns


def box(half: float, at: tuple[float, float, float] = (0.0, 0.0, 120.0), **given: object) -> Accessory:
    """A closed cube, counter-clockwise from outside."""
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))], np.int32)
    made = Accessory(
        "Box", "hair", half * corner + np.float32(at), corner / np.float32(np.sqrt(3)),
        np.zeros((8, 2), np.float32), triangles, np.ones(8, np.float32), (0.1, 0.6, 0.1, 1.0),
    )  # fmt: skip
    return replace(made, **given)  # type: ignore[arg-type]


def sides(one: Accessory) -> set[tuple[int, ...]]:
    """Triangles by their first corner and direction round."""
    assert one.outside is not None
    return {tuple(np.roll(t, -int(np.argmin(t)))) for t in one.outside.tolist()}


def head() -> Head:
    return Head(small_head(neck=TURNS))


def test_of_a_closed_box_only_fronts_are_seen_and_nothing_of_one_within_it(gl: None) -> None:
    outer, inner = with_outside(head(), [box(30.0), box(20.0)])
    assert sides(outer) == {tuple(np.roll(t, -int(np.argmin(t)))) for t in outer.triangles.tolist()}
    assert sides(inner) == set()


def test_a_card_is_seen_from_both_sides_and_only_its_front_where_skin_lies_behind_it(gl: None) -> None:
    alone, close = with_outside(head(), [card(z=200.0), card((-30.0, -12.0), (-10.0, 12.0), z=28.5)])
    assert len(sides(alone)) == 4
    assert close.outside is not None
    front = np.cross(*(close.vertices[close.outside[:, k]] - close.vertices[close.outside[:, 0]] for k in (1, 2)))
    assert (front[:, 2] > 0).any()


def test_a_box_with_a_hole_shows_its_inside(gl: None) -> None:
    whole = box(30.0)
    open_box = replace(whole, triangles=whole.triangles[2:])
    (found,) = with_outside(head(), [open_box])
    assert len(sides(found)) > len(open_box.triangles)


def test_what_one_sees_through_is_left_as_it_is(gl: None) -> None:
    (inner, _) = with_outside(head(), [box(20.0), box(30.0, alpha="BLEND")])
    assert len(sides(inner)) == 12
    assert with_outside(head(), [box(30.0, alpha="MASK")])[0].outside is None


def test_what_turns_by_itself_hides_nothing(gl: None) -> None:
    """Hair on the shoulders moves beside that on the head."""
    upper = Head(small_head(neck=Neck((0.0, 0.0, 0.0), 0.0, -60.0, -30.0)))
    large, small = with_outside(upper, [box(40.0), box(20.0)])
    assert len(sides(large)) >= 12 and len(sides(small)) == 12


def test_skin_hides_what_lies_behind_it_where_it_turns_with_the_whole_head(gl: None) -> None:
    def fronts(neck: Neck) -> int:
        ctx = outside.open_context()
        try:
            pictures = outside._SidePictures(
                ctx, Head(small_head(neck=neck)), [card((-15.0, -8.0), (15.0, 8.0), z=12.0)]
            )
            return int(sum(pixels[1:, 0].sum() for pixels in pictures.look()))
        finally:
            ctx.release()

    assert 0 < fronts(TURNS) < 0.6 * fronts(Neck((0.0, 0.0, 0.0), 0.0, 90.0, 160.0))


def test_what_an_open_pose_moves_hides_nothing(gl: None) -> None:
    still = {part.name: bool(rows.any()) for part, rows in outside._still(head())}
    assert still == {"a": True, "b": True, "tooth": False}


def test_narrow_triangles_beside_what_is_seen_count_as_seen() -> None:
    thin = replace(card(z=60.0), vertices=np.array([[0, 0, 0], [40, 0, 0], [40, 1, 0], [0, 40, 0]], np.float32))
    seen = np.array([[False, False], [True, False]])
    assert outside._widened(thin, seen).tolist() == [[True, False], [True, False]]
    wide = replace(thin, vertices=np.array([[0, 0, 0], [40, 0, 0], [40, 9, 0], [0, 40, 0]], np.float32))
    assert outside._widened(wide, seen).tolist() == [[False, False], [True, False]]


@pytest.mark.parametrize("quality", ["full", "fast"])
def test_live_pictures_draw_only_what_can_be_seen_and_stay_the_same(gl: None, quality: str) -> None:
    worn = [box(30.0), box(20.0), card((-60.0, -60.0), (-20.0, 60.0), z=150.0, kind="hair")]
    known = with_outside(head(), worn)
    pictures, counts = [], []
    for accessories in (worn, known):
        wearer = head()
        wearer.accessories = tuple(WornMesh(one, TURNS) for one in accessories)
        with Offscreen(wearer, (200, 200), quality=quality) as screen:
            for yaw in (0.0, 50.0, 180.0):
                screen.draw(np.zeros(len(wearer.parameters)), Camera.around(yaw))
                screen.finish()
                pictures.append(screen.target.read().astype(int))
            assert screen.renderer._accessories is not None
            counts.append([(one.array.vertices, one.two_sided) for one in screen.renderer._accessories._drawn])
            software = screen._sampling.simplified
    assert np.abs(np.array(pictures[:3]) - pictures[3:]).max() <= 2
    assert pictures[0].std() > 5.0
    every = [(36, True), (36, True), (6, True)]
    assert counts == [every, [(36, False), (12, False)] if software else every]


def test_it_is_kept_with_the_accessories_of_a_head(gl: None, tmp_path: Path) -> None:
    save_data(tmp_path, small_head(neck=TURNS))
    assert find_outside(tmp_path) is None
    write_accessories(tmp_path, [box(30.0)])
    path = find_outside(tmp_path)
    assert path is not None
    (found,) = read_accessories(tmp_path)
    assert len(sides(found)) == 12
    assert find_outside(tmp_path) == path
