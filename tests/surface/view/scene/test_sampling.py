"""surface.view.scene.sampling"""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from ball_head import BallHead, values

from surface.view import Offscreen
from surface.view.pictures.offscreen import open_context
from surface.view.scene.sampling import BUDGET_S, SCALE, AdaptiveSampling, is_software

SLOW, QUICK = 2 * BUDGET_S, 0.5 * BUDGET_S


def run(sampling: AdaptiveSampling, seconds: float, frames: int = 100) -> int:
    sampling.start_live()
    for _ in range(frames):
        sampling.add_frame(seconds)
    return sampling.settings[0]


def test_stills_take_all_samples() -> None:
    assert AdaptiveSampling("full", software=True).settings[0] == 4
    assert AdaptiveSampling("fast").settings[0] == 1


def test_live_pictures_begin_with_one_sample_in_software() -> None:
    assert run(AdaptiveSampling("full", software=True), 0.0, 0) == 1
    assert run(AdaptiveSampling("full"), 0.0, 0) == 4


def test_a_live_fast_picture_is_drawn_smaller_in_software() -> None:
    for quality, software, scale in (("fast", True, SCALE), ("fast", False, 1.0), ("full", True, 1.0)):
        sampling = AdaptiveSampling(quality, software=software)
        assert sampling.settings[1] == 1.0
        sampling.start_live()
        assert sampling.settings == (sampling.settings[0], scale)


@pytest.mark.parametrize(("seconds", "samples"), [(SLOW, 1), (QUICK, 4)])
def test_elsewhere_they_fall_back_only_when_slow(seconds: float, samples: int) -> None:
    assert run(AdaptiveSampling("full"), seconds) == samples


def test_a_single_slow_frame_is_forgiven() -> None:
    sampling = AdaptiveSampling("full")
    sampling.start_live()
    for k in range(60):
        sampling.add_frame(3 * BUDGET_S if k % 15 == 7 else QUICK)
    assert sampling.settings[0] == 4


@pytest.mark.parametrize("samples", [1, 2, 4])
def test_samples_asked_for_are_kept(samples: int) -> None:
    assert run(AdaptiveSampling("full", samples, software=True), SLOW) == samples


def test_a_live_picture_changes_its_target(gl: None) -> None:
    with Offscreen(BallHead(), (64, 64)) as screen:
        still = screen.render(values())
        assert screen.target.samples == 4
        screen.draw(values())
        assert screen.target.samples == (1 if is_software(screen.ctx) else 4)
        assert abs(screen.render(values()).astype(int) - still).mean() < 3


def test_software_is_known_by_the_drivers_name(gl: None) -> None:
    ctx = open_context()
    try:
        name = ctx.info["GL_RENDERER"]
        assert is_software(ctx) == any(word in name.lower() for word in ("llvmpipe", "softpipe", "software"))
    finally:
        ctx.release()


def test_the_budget_is_a_mean_of_fifteen_frames() -> None:
    for share, samples in ((0.99, 4), (1.01, 1)):
        sampling = AdaptiveSampling("full")
        sampling.start_live()
        for _ in range(14):
            sampling.add_frame(share * BUDGET_S)
        assert sampling.settings == (4, 1.0)
        sampling.add_frame(share * BUDGET_S)
        assert sampling.settings == (samples, 1.0)


def test_the_mean_begins_again_after_fifteen_frames() -> None:
    sampling = AdaptiveSampling("full")
    sampling.start_live()
    for k in range(30):
        sampling.add_frame(1.9 * BUDGET_S if k % 15 < 7 else 0.0)
    assert sampling.settings == (4, 1.0)


def test_only_live_adaptive_pictures_in_software_are_simplified() -> None:
    for samples, software, simplified in ((None, True, True), (None, False, False), (2, True, False)):
        sampling = AdaptiveSampling("fast", samples, software=software)
        assert not sampling.simplified and not sampling.live
        sampling.start_live()
        assert sampling.live and sampling.simplified == simplified


@pytest.mark.parametrize("name", ["llvmpipe (LLVM 15)", "SwiftShader", "Microsoft software rasterizer", "softpipe"])
def test_software_renderers_by_name(name: str) -> None:
    assert is_software(SimpleNamespace(info={"GL_RENDERER": name}))
    assert not is_software(SimpleNamespace(info={"GL_RENDERER": "NVIDIA GeForce"}))
