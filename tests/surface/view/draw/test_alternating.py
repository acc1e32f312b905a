"""surface.view.draw.alternating"""

from __future__ import annotations

import numpy as np
import pytest
from ball_head import BallHead, values

from surface.head import Head
from surface.view import Offscreen
from surface.view.draw.alternating import Dissolve
from surface.view.draw.target import Target, read_pixels
from surface.view.pictures.offscreen import AdaptiveOffscreen
from surface.view.scene.choice import FRAMES, STUTTER_FRAMES

SIZE = (240, 180)


class SlowClock:
    """The time by a renderer's own clock: every reading is a frame of "full" later than the last."""

    def __init__(self, step_s: float) -> None:
        self.now_s, self.step_s = 0.0, step_s

    def __call__(self) -> float:
        self.now_s += self.step_s
        return self.now_s


def blinking(k: int) -> np.ndarray:
    return values(eyeBlinkLeft=float(k % 2), jawOpen=0.01 * (k % 7))


@pytest.mark.slow
def test_a_slow_renderer_dissolves_from_full_to_fast_and_shows_its_pictures(gl: None) -> None:
    head, pictures, levels = BallHead(), [], []
    with AdaptiveOffscreen(head, SIZE, rate_hz=60.0, now_s=SlowClock(0.03)) as screen:
        for k in range(80):
            screen.draw(blinking(k))
            levels.append((screen.choice.level, screen.choice.share))
            pictures.append(screen.read().astype(float))
            if levels[-1] == ("fast", 1.0):
                break
        assert screen.renderer.quality == "fast"
    assert screen.choice.switches == 1 and levels[-1] == ("fast", 1.0) and len(levels) > STUTTER_FRAMES
    at = levels.index(("fast", 1.0 / FRAMES))
    assert len(levels) - at > 2, "it dissolves"
    with Offscreen(BallHead(), SIZE) as full, Offscreen(BallHead(), SIZE, quality="fast") as fast:
        for k in (at - 1, at, at + 1, len(levels) - 1):
            share = levels[k][1] if levels[k][0] == "fast" else 0.0
            both = []
            for one in (full, fast):
                one.draw(blinking(k))
                both.append(one.read().astype(float))
            wanted = (1.0 - share) * both[0] + share * both[1]
            assert np.abs(pictures[k] - wanted).max() <= 2.0, (k, share)


@pytest.mark.slow
def test_the_shipped_head_alternates_with_its_decimated_triangles(gl: None, root) -> None:  # type: ignore[no-untyped-def]
    head = Head.load(root / "configs" / "heads" / "ict")
    poses = [head.values({"eyeBlinkLeft": float(k % 2), "jawOpen": 0.1}) for k in range(2)]
    with AdaptiveOffscreen(head, SIZE, rate_hz=60.0, now_s=SlowClock(0.03)) as screen:
        screen.go_live()
        for k in range(60):
            screen.draw(poses[k % 2])
        assert screen.choice.level == "fast"
        screen.draw(poses[1])
        found = screen.read().astype(float)
    with Offscreen(head, SIZE, quality="fast") as fast:
        fast.draw(poses[1])
        assert np.abs(found - fast.read()).max() <= 2.0


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_pictures_are_mixed_by_their_share(gl: None, share: float) -> None:
    with Offscreen(BallHead(), SIZE) as screen:
        targets = []
        for yaw in (0.0, 1.0):
            target = Target(screen.ctx, SIZE, 1)
            screen.renderer.pose(values(headYaw=yaw))
            screen.renderer.update()
            target.paint(screen.renderer, screen._front)
            target.complete()
            targets.append(target)
        dissolve = Dissolve(screen.ctx, SIZE)
        found = read_pixels(dissolve.mix(*targets, share)).astype(float)
        one, two = (target.read().astype(float) for target in targets)
        assert np.abs(one - two).max() > 20.0
        assert np.abs(found - (one + share * (two - one))).max() <= 1.0
        dissolve.release()
        for target in targets:
            target.release()
        assert screen.ctx.error == "GL_NO_ERROR"
