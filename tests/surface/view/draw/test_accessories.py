"""surface.view.draw.accessories: drawn with their textures, in front of the face, turned with the head."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from ball_head import BallHead, values
from cards import card, picture
from PIL import Image
from small_head import small_head

from surface.base.errors import ViewError
from surface.head import Head
from surface.head.model.accessories import Accessory
from surface.head.model.data import Neck
from surface.head.posing.dressing import WornMesh
from surface.view import Camera, Offscreen
from surface.view.draw import accessories as drawing

SIZE = (160, 160)
NECK = Neck((0.0, 0.0, 0.0), 0.0, -500.0, -400.0)  # all of it turns
GREEN = (20, 160, 20, 255)


def drawn(accessories: Sequence[Accessory], camera: Camera | None = None, **given: Any) -> np.ndarray:
    """A picture of a ball that wears them."""
    head: Any = BallHead()
    head.accessories = tuple(WornMesh(one, NECK) for one in accessories)
    with Offscreen(head, SIZE, **given) as screen:
        return screen.render(values(), camera).astype(int)


def greens(picture: np.ndarray) -> np.ndarray:
    """Where a picture shows the green of the tests' cards, which no face has."""
    return (
        (picture[..., 1] > 60) & (picture[..., 0] < 0.6 * picture[..., 1]) & (picture[..., 2] < 0.6 * picture[..., 1])
    )


def green(*place: Any, **given: Any) -> Accessory:
    return card(*place, **{"texture": picture(GREEN)} | given)


FRONT = green(z=115.0)


@pytest.mark.parametrize("quality", ["full", "fast"])
@pytest.mark.parametrize("evaluator", ["cpu", "gpu"])
def test_a_card_shows_its_colour_before_the_face(gl: None, quality: str, evaluator: str) -> None:
    if evaluator == "gpu":
        head = Head(small_head())
        head.accessories = (WornMesh(green((-30.0, -15.0), (10.0, 15.0), z=60.0), NECK),)
        with Offscreen(head, SIZE, quality=quality, evaluator="gpu") as screen:
            assert greens(screen.render(np.zeros(len(head.parameters))).astype(int)).sum() > 100
        return
    assert not greens(drawn([], quality=quality)).any()
    seen = greens(drawn([FRONT], quality=quality))
    assert 360 < seen.sum() < 440  # 40 mm are 20 pixels here
    assert abs(np.nonzero(seen)[1].mean() - SIZE[0] / 2) < 3


def test_the_face_hides_what_lies_behind_it(gl: None) -> None:
    assert not greens(drawn([green(z=-20.0)])).any()


@pytest.mark.parametrize("samples", [1, 4])
def test_nothing_is_drawn_where_a_texture_is_clear(gl: None, samples: int) -> None:
    hole = replace(FRONT, texture=picture(GREEN, (64, 64), hole=True), alpha="MASK")
    seen, solid = (greens(drawn([one], samples=samples)) for one in (hole, FRONT))
    assert 0.42 < seen.sum() / solid.sum() < 0.58
    columns = np.nonzero(seen)[1]
    assert columns.max() <= SIZE[0] / 2 + 2  # the picture's left is drawn
    ignored = replace(hole, alpha="OPAQUE")
    white = drawn([ignored], samples=samples)[SIZE[1] // 2 - 20 : SIZE[1] // 2, SIZE[0] // 2 + 3 : SIZE[0] // 2 + 10]
    assert white.min() > 120


def test_a_blended_one_lets_the_face_and_the_background_through(gl: None) -> None:
    wide = card((-150.0, -30.0), (150.0, 30.0), z=115.0, colour=(1.0, 1.0, 1.0, 0.5), alpha="BLEND")
    bare, solid, half = drawn([]), drawn([replace(wide, alpha="OPAQUE")]), drawn([wide])
    changed = (np.abs(solid - bare) > 30).any(axis=2)
    for place in ((slice(75, 80), slice(78, 82)), (slice(75, 80), slice(4, 8))):  # over the face, over the background
        assert changed[place].all()
        np.testing.assert_allclose(half[place], 0.5 * (bare[place] + solid[place]), atol=4)


def test_what_is_behind_glass_is_not_cut_off_by_it(gl: None) -> None:
    glass = card((-40.0, -40.0), (40.0, 40.0), z=115.0, colour=(1.0, 1.0, 1.0, 0.5), alpha="BLEND")
    behind = card((-10.0, -10.0), (10.0, 10.0), z=105.0, texture=picture(GREEN))
    seen = drawn([glass, behind])[SIZE[1] // 2, SIZE[0] // 2]
    assert seen[1] > drawn([glass])[SIZE[1] // 2, SIZE[0] // 2][1] - 80 and (seen != drawn([glass])[80, 80]).any()


def test_backs_are_drawn_only_of_what_has_two_sides(gl: None) -> None:
    behind = Camera.around(180.0)
    far = green(z=-140.0)  # looks ahead, so that its back is seen
    assert greens(drawn([far], behind)).sum() > 300
    assert not greens(drawn([replace(far, two_sided=False)], behind)).any()


@pytest.mark.parametrize("theme", ["mask", "robot"])
def test_a_mask_and_a_robot_wear_nothing(gl: None, theme: str) -> None:
    np.testing.assert_array_equal(drawn([FRONT], theme=theme), drawn([], theme=theme))


@pytest.mark.parametrize("live", [False, True])
def test_they_turn_with_the_head(gl: None, live: bool) -> None:
    head = Head(small_head(neck=Neck((0.0, 0.0, 0.0), 0.0, -500.0, -400.0)))
    head.accessories = tuple(WornMesh(green((-15.0, -15.0), (15.0, 15.0), z=70.0), head.data.neck) for _ in range(1))
    with Offscreen(head, SIZE) as screen:
        if live:
            screen.go_live()
        still, turned = (
            np.nonzero(greens(screen.render(head.values({"headYaw": yaw}), Camera.front()).astype(int)))[1].mean()
            for yaw in (0.0, 1.0)
        )
        again = np.nonzero(greens(screen.render(head.values({}), Camera.front()).astype(int)))[1].mean()
    assert turned - still > 10 and abs(again - still) < 0.5


def test_what_was_drawn_before_the_head_turned_is_erased(gl: None) -> None:
    head = Head(small_head(neck=Neck((0.0, 0.0, 0.0), 0.0, -500.0, -400.0)))
    wide = card((-120.0, 60.0), (120.0, 80.0), z=0.0)
    head.accessories = (WornMesh(wide, head.data.neck),)
    with Offscreen(head, SIZE) as screen:
        for yaw in (0.0, 1.0):
            screen.render(head.values({"headYaw": yaw}), Camera.front())
        shown = screen.read()
    with Offscreen(head, SIZE) as fresh:
        np.testing.assert_array_equal(shown, fresh.render(head.values({"headYaw": 1.0}), Camera.front()))


def warnings(one: Accessory, caplog: pytest.LogCaptureFixture) -> tuple[np.ndarray, list[str]]:
    """A picture of a ball that wears it, drawn twice, and what was logged."""
    drawing._warn_once.cache_clear()
    with caplog.at_level("WARNING", drawing.__name__):
        seen = [drawn([one]) for _ in range(2)]
    return seen[1], [record.getMessage() for record in caplog.records]


@pytest.mark.parametrize("data", [b"\x89PNG broken", picture(GREEN, (300, 300))[:-200]])
def test_what_has_a_damaged_texture_is_drawn_in_its_own_colour_and_named_once(
    gl: None, data: bytes, caplog: pytest.LogCaptureFixture
) -> None:  # fmt: skip
    seen, said = warnings(replace(FRONT, texture=data, colour=(0.01, 0.4, 0.01, 1.0)), caplog)
    assert greens(seen).sum() > 300
    assert len(said) == 1 and said[0].startswith("Card: its texture cannot be read (") and "object at" not in said[0]


def test_a_texture_of_too_many_pixels_is_not_decoded(gl: None, caplog: pytest.LogCaptureFixture) -> None:
    out = io.BytesIO()
    Image.new("1", (4097, 4096)).save(out, "PNG")
    _, said = warnings(replace(FRONT, texture=out.getvalue()), caplog)
    assert "4097 x 4096 pixels are too many" in said[0]


def test_a_texture_longer_than_the_driver_draws_is_refused() -> None:
    with pytest.raises(ViewError, match="Card: its texture has 64 pixels, 63 are the most here"):
        drawing.decoded_picture(replace(FRONT, texture=picture(GREEN, (64, 2))), 63)


def test_greys_of_16_bits_keep_their_tone() -> None:
    out = io.BytesIO()
    Image.fromarray(np.full((1, 2), 257 * 100, np.uint16)).save(out, "PNG")
    assert drawing.decoded_picture(replace(FRONT, texture=out.getvalue()), 64) == (
        (2, 1),
        bytes([100, 100, 100, 255] * 2),
    )
