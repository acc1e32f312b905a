"""surface.view.pictures.sheet"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ball_head import BallHead, values
from cards import card
from PIL import Image
from small_head import small_head

from surface.base.errors import ViewError
from surface.head import Crowd, Head
from surface.head.posing.dressing import WornMesh
from surface.view import Camera, Offscreen, contact_sheet, write_png
from surface.view.pictures.sheet import compose, crowd_sheet, zoom_to_head


def plain(colour: tuple[int, int, int], size: tuple[int, int] = (60, 80)) -> np.ndarray:
    return np.full((size[1], size[0], 3), colour, np.uint8)


def test_compose_places_pictures_in_reading_order() -> None:
    colours = [(200, 0, 0), (0, 200, 0), (0, 0, 200)]
    page = np.asarray(compose([plain(c) for c in colours], ["a", "b", "c"], columns=2))
    height, width = page.shape[:2]
    assert tuple(page[40, 30]) == colours[0]
    assert tuple(page[40, width - 30]) == colours[1]
    assert tuple(page[height - 50, 30]) == colours[2]
    for colour in colours:
        assert (page == colour).all(axis=2).sum() == 60 * 80


def test_labels_are_written_and_fit() -> None:
    short = np.asarray(compose([plain((9, 9, 9))], ["jawOpen"]))
    long = np.asarray(compose([plain((9, 9, 9))], ["a label much too long for its tile"]))
    for page in (short, long):
        ink = (page.min(axis=2) > 150).any(axis=0)
        assert ink.sum() > 10
        assert not ink[:3].any()
        assert not ink[-3:].any()


def test_contact_sheet_draws_entries_and_views(gl: None) -> None:
    seen: list[tuple[int, int]] = []
    entries = [("rest", values()), ("jawOpen", values(jawOpen=1)), ("headYaw", values(headYaw=1))]
    views = (Camera.front(), Camera.profile())
    sheet = contact_sheet(
        BallHead(), entries, views=views, tile=(60, 64), columns=1, progress=lambda *at: seen.append(at)
    )
    page = np.asarray(sheet).astype(int)
    assert seen == [(1, 3), (2, 3), (3, 3)]
    assert page.shape[1] == 2 * 60 + 8
    rows = [page[y : y + 64] for y in range(4, page.shape[0] - 64, (page.shape[0] - 4) // 3)]
    assert len(rows) == 3
    assert np.abs(rows[0] - rows[1]).max() > 50
    assert np.abs(rows[0] - rows[2]).max() > 50


def test_refusals() -> None:
    with pytest.raises(ViewError, match="at least one"):
        compose([], [])
    with pytest.raises(ValueError, match="1 labels for 2"):
        compose([plain((1, 1, 1))] * 2, ["a"])
    with pytest.raises(ValueError, match=r"pictures\[1\]"):
        compose([plain((1, 1, 1)), plain((1, 1, 1), (10, 10))], ["a", "b"])


def test_write_png_round_trips(tmp_path: Path) -> None:
    picture = np.random.default_rng(0).integers(0, 256, (20, 30, 3), dtype=np.uint8)
    write_png(picture, tmp_path / "a.png")
    assert (np.asarray(Image.open(tmp_path / "a.png")) == picture).all()
    write_png(Image.fromarray(picture), tmp_path / "b.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_profile_is_seen_from_further_than_a_front() -> None:
    front, side = zoom_to_head(Camera.front()), zoom_to_head(Camera.profile())
    assert front.distance < side.distance / 1.1
    assert side.distance < Camera.profile().distance


@pytest.mark.parametrize(
    ("count", "size", "columns", "across", "down"),
    [
        (1, (60, 80), None, 1, 1),
        (4, (60, 80), None, 3, 2),
        (9, (100, 82), None, 3, 3),
        (5, (60, 80), 3, 3, 2),
        (6, (60, 80), 3, 3, 2),
        (2, (60, 80), 9, 2, 1),
        (2, (60, 80), 0, 1, 2),
        (3, (600, 20), None, 1, 3),
    ],
)
def test_a_page_has_room_for_all_pictures(
    count: int, size: tuple[int, int], columns: int | None, across: int, down: int
) -> None:
    page = np.asarray(compose([plain((1, 2, 3), size)] * count, [""] * count, columns=columns))
    line = max(18, size[1] // 13)
    assert page.shape == ((size[1] + line + 4) * down + 4, (size[0] + 4) * across + 4, 3)
    assert (page == (1, 2, 3)).all(axis=2).sum() == count * size[0] * size[1]
    assert page[0, 0].tolist() == page[-1, -1].tolist() == [24, 26, 29]
    assert page[4, 4].tolist() == [1, 2, 3] and page[3, 4].tolist() == [24, 26, 29]


def test_a_label_is_written_in_the_middle_of_its_line() -> None:
    page = np.asarray(compose([plain((0, 0, 0), (200, 260))] * 2, ["", "\N{MINUS SIGN}M"], columns=2)).astype(int)
    rows, columns = np.nonzero(page.min(axis=2) > 150)
    assert rows.min() > 4 + 260 and rows.max() < 4 + 260 + 20
    assert pytest.approx((rows.min() + rows.max()) / 2, abs=2) == 4 + 260 + 10
    assert pytest.approx((columns.min() + columns.max()) / 2, abs=2) == 4 + 204 + 100
    dash = np.asarray(compose([plain((0, 0, 0), (200, 260))] * 2, ["", "-M"], columns=2))
    assert (page == dash).all()


def test_long_labels_get_smaller_then_shorter() -> None:
    def ink(label: str) -> np.ndarray:
        page = np.asarray(compose([plain((0, 0, 0), (120, 330))], [label])).astype(int)
        return np.argwhere(page.min(axis=2) > 100)

    short, middle, long = (np.ptp(ink("E" * count), axis=0) for count in (3, 12, 60))
    assert short[0] > middle[0] >= long[0] >= 5
    assert short[1] < middle[1] <= 114 and 80 < long[1] <= 114


def test_a_head_is_nearer_and_higher_on_a_sheet() -> None:
    camera = Camera.front()
    near = zoom_to_head(camera)
    assert near.target == pytest.approx((camera.target[0], camera.target[1] + 30, camera.target[2]))
    assert near.distance == pytest.approx(camera.distance / 1.36)
    side = zoom_to_head(Camera.profile())
    assert side.distance == pytest.approx(Camera.profile().distance / 1.16)


def test_pictures_of_a_mask_are_the_same_with_a_hat_that_they_do_not_draw(gl: None) -> None:
    bare, hat = Head(small_head()), Head(small_head())
    hat.accessories = (WornMesh(card((-300.0, 0.0), (300.0, 400.0), z=-5.0), hat.data.neck),)
    rest = ("rest", np.zeros(len(bare.parameters)))
    for theme, same in (("mask", True), ("robot", True), ("skin", False)):
        crowds = Crowd(bare, 1), Crowd(hat, 1)
        pages = [np.asarray(contact_sheet(head, [rest], tile=(60, 60), theme=theme)) for head in (bare, hat)]
        pages += [np.asarray(crowd_sheet(crowd, ["rest"], tile=(60, 60), theme=theme)) for crowd in crowds]
        assert (pages[0] == pages[1]).all() == (pages[2] == pages[3]).all() == same
        with Offscreen(bare, (60, 60), theme=theme) as a, Offscreen(hat, (60, 60), theme=theme) as b:
            assert (a.render(rest[1]) == b.render(rest[1])).all() == same
            assert a.renderer._middle_z == b.renderer._middle_z
