"""shaders/smooth.frag and enlarge.frag: edges of a picture with one sample per pixel."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from surface.head import Head
from surface.view import Camera, Offscreen
from surface.view.draw.target import Target
from surface.view.pictures.offscreen import open_context
from surface.view.scene.bounds import Bands
from surface.view.scene.theme import Theme

if TYPE_CHECKING:
    import moderngl

WIDTH, HEIGHT = 64, 48
DARK, LIGHT = 60, 200
STRAND = 128  # alpha of strands, of 255


@pytest.fixture
def ctx(gl: None) -> Iterator[moderngl.Context]:
    made = open_context()
    yield made
    made.release()


class Painted:
    """Draws given pixels, (height, width, 4) uint8, in place of a head."""

    revision, theme = 0, Theme()

    def __init__(self, pixels: np.ndarray) -> None:
        self.pixels = pixels

    def region(self, camera: Camera, size: tuple[int, int]) -> Bands:
        return Bands.whole(size)

    def draw(self, camera: Camera, target: Any, bands: Bands) -> None:
        target.color_attachments[0].write(np.ascontiguousarray(self.pixels[::-1]).tobytes())


def shown(ctx: moderngl.Context, pixels: np.ndarray, alpha: np.ndarray | int = 255, scale: float = 1.0) -> np.ndarray:
    """What becomes of grey pixels (height, width), of a picture drawn at ``scale``: the same, or larger, float."""
    whole = np.stack([pixels, pixels, pixels, np.broadcast_to(alpha, pixels.shape)], axis=-1).astype(np.uint8)
    size = round(pixels.shape[1] / scale), round(pixels.shape[0] / scale)
    target = Target(ctx, size, 1, scale)
    target.paint(Painted(whole), Camera.front())  # type: ignore[arg-type]
    picture = target.read().astype(float)
    target.release()
    assert (np.ptp(picture, axis=2) == 0).all(), "grey stays grey"
    return np.asarray(picture[..., 0])


def slanted(slope: float, samples: int) -> np.ndarray:
    """Share (HEIGHT, WIDTH) of each pixel that lies below a slanted line, by ``samples`` squared places in it."""
    x = (np.arange(WIDTH * samples) + 0.5) / samples
    y = (np.arange(HEIGHT * samples) + 0.5) / samples
    below = y[:, None] > 0.5 * HEIGHT + slope * (x - 0.5 * WIDTH)
    return below.reshape(HEIGHT, samples, WIDTH, samples).mean(axis=(1, 3))


@pytest.mark.parametrize("slope", [1 / 3, -1 / 5, 1 / 9, 1 / 17])
@pytest.mark.parametrize("upright", [False, True])
@pytest.mark.parametrize("colours", [(DARK, LIGHT), (LIGHT, DARK)])
def test_a_slanted_edge_is_nearer_to_what_it_covers(
    ctx: moderngl.Context, slope: float, upright: bool, colours: tuple[int, int]
) -> None:
    steps, covered = (colours[0] + (colours[1] - colours[0]) * slanted(slope, n) for n in (1, 16))
    if upright:
        steps, covered = (np.swapaxes(a, 0, 1)[:HEIGHT, :HEIGHT] for a in (steps, covered))
    inside = slice(12, -12), slice(12, -12)  # ends of steps at the picture's edge are out of sight
    before, after = (np.sqrt(((a - covered)[inside] ** 2).mean()) for a in (steps, shown(ctx, steps)))
    assert after < 0.5 * before


def test_level_edges_corners_and_faint_differences_stay(ctx: moderngl.Context) -> None:
    square = np.full((HEIGHT, WIDTH), DARK)
    square[10:30, 15:45] = LIGHT
    off = np.abs(shown(ctx, square) - square)
    near = np.zeros(off.shape, bool)
    for y in (10, 30):
        for x in (15, 45):
            near[y - 9 : y + 9, x - 9 : x + 9] = True
    assert off[~near].max() < 0.06 * (LIGHT - DARK), "no end is near"
    assert 0.3 * (LIGHT - DARK) < off.max() < 0.5 * (LIGHT - DARK), "corners become round"
    grain = DARK + np.random.default_rng(5).integers(0, 9, (HEIGHT, WIDTH))
    assert (shown(ctx, grain) == grain).all()


def test_a_pixel_that_stands_out_alone_fades(ctx: moderngl.Context) -> None:
    pixels = np.full((HEIGHT, WIDTH), DARK)
    pixels[20, 30] = LIGHT
    found = shown(ctx, pixels)
    assert DARK < found[20, 30] < DARK + 0.4 * (LIGHT - DARK)


def test_ends_of_strands_become_the_weighted_mean_of_nine(ctx: moderngl.Context) -> None:
    hair = np.random.default_rng(4).uniform(size=(HEIGHT, WIDTH)) < np.linspace(-0.3, 1.3, WIDTH)
    pixels = np.where(hair, DARK, LIGHT)
    found = shown(ctx, pixels, np.where(hair, STRAND, 255))
    weights = np.outer([1, 2, 1], [1, 2, 1]) / 16
    padded = np.pad(pixels, 1, mode="edge")
    mean = sum(weights[i, j] * padded[i : i + HEIGHT, j : j + WIDTH] for i in range(3) for j in range(3))
    sides = np.pad(hair, 1, mode="edge")
    cross = np.stack([sides[1:-1, 1:-1], sides[:-2, 1:-1], sides[2:, 1:-1], sides[1:-1, :-2], sides[1:-1, 2:]])
    fringe = cross.any(axis=0) & ~cross.all(axis=0)
    assert fringe.mean() > 0.4
    assert np.abs(found - mean)[fringe].max() <= 1.0


def test_within_hair_no_edge_is_followed(ctx: moderngl.Context) -> None:
    steps = DARK + (LIGHT - DARK) * slanted(1 / 9, 1)
    off = np.abs(shown(ctx, steps, STRAND) - steps)
    assert 0.05 < off.max() / (LIGHT - DARK) < 0.32, "half of the neighbours differ where a step ends"


def test_what_is_blended_is_no_strand(gl: None, root: Path) -> None:
    """Lashes and brows are blended with the skin behind them, which has an alpha of 1."""
    head = Head.load(root / "configs" / "heads" / "ict")
    with Offscreen(head, (320, 320), samples=1) as screen:
        screen.render(head.values({}))
        assert set(screen.target._drawn.read(components=4)[3::4]) == {255}


def test_faint_edges_are_smoothed_in_part(ctx: moderngl.Context) -> None:
    off = [np.abs(shown(ctx, steps) - steps).max() / high
           for high in (8, 11, 40) for steps in [np.round(DARK + high * slanted(1 / 9, 1))]]  # fmt: skip
    assert off[0] == 0 < off[1] < 0.6 * off[2]


def test_a_smaller_picture_is_enlarged_evenly(ctx: moderngl.Context) -> None:
    ramp = np.broadcast_to(4.0 * np.arange(WIDTH), (HEIGHT, WIDTH))
    found = shown(ctx, ramp, scale=0.5)
    x = np.clip((np.arange(2 * WIDTH) + 0.5) / 2 - 0.5, 0, WIDTH - 1)
    wanted = np.interp(x, np.arange(WIDTH), ramp[0])
    assert np.abs(found - wanted).max() <= 0.75
