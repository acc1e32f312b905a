"""surface.view.draw.evaluator"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ball_head import BallHead

from surface.base.errors import ViewError
from surface.head import Head
from surface.head.posing.kernels import place_vertices
from surface.view import Camera, Offscreen
from surface.view.draw.evaluator import EVALUATORS, why_not_gpu
from surface.view.pictures.offscreen import open_context

SIZE = (220, 200)
CAMERAS = (Camera.front(), Camera.three_quarter(), Camera.front().zoom(2.5), Camera.profile())


@pytest.fixture(scope="module")
def head(root: Path) -> Head:
    return Head.load(root / "configs" / "heads" / "ict")


@pytest.fixture(scope="module")
def screens(gl: None, root: Path) -> Iterator[dict[str, Offscreen]]:
    folder = root / "configs" / "heads" / "ict"
    made = {name: Offscreen(Head.load(folder), SIZE, evaluator=name) for name in ("cpu", "gpu")}
    yield made
    for screen in made.values():
        screen.close()


def poses(head: Head) -> list[np.ndarray]:
    random = np.random.default_rng(4)
    return [np.zeros(len(head.parameters)), *(random.uniform(-0.3, 0.8, (3, len(head.parameters))))]


@pytest.mark.slow
def test_both_draw_the_same_picture(screens: dict[str, Offscreen], head: Head) -> None:
    for values, camera in zip(poses(head), CAMERAS, strict=True):
        cpu, gpu = (screens[name].render(values, camera).astype(int) for name in ("cpu", "gpu"))
        assert cpu.std() > 20
        assert np.abs(cpu - gpu).mean() < 0.01
        assert (np.abs(cpu - gpu).max(axis=2) > 8).mean() < 1e-3


def test_the_graphics_processor_writes_the_vertices_and_normals_of_the_engine(
    screens: dict[str, Offscreen], head: Head
) -> None:
    """What transform feedback wrote, read back: within 0.0002 mm, less than a millionth of the head's size, and 0.2
    degrees, nearly all within 0.02: the engine keeps derivatives in 16 bits. Where two parts meet the engine moves one
    border onto the other, which is left out."""
    renderer = screens["gpu"].renderer
    for values in poses(head):
        renderer.pose(values)
        renderer.update()
        head.pose(values)
        for buffers in renderer._parts:
            part = head.part(buffers.part.name)
            rows = np.frombuffer(buffers.feedback.read(), np.float32).reshape(-1, 6)
            own = np.ones(len(rows), bool)
            for stitch in head.stitches:
                own[stitch.ids if stitch.second is part else []] = False
            assert np.linalg.norm(rows[own, :3] - part.vertices[own], axis=1).max() < 2e-4
            apart = np.degrees(np.linalg.norm(rows[own, 3:] - part.normals[own], axis=1))
            assert apart.max() < 0.2, part.name
            assert np.quantile(apart, 0.99) < 0.02, part.name


def test_both_know_where_vertices_are(screens: dict[str, Offscreen], head: Head) -> None:
    values = poses(head)[2]
    for name in ("cpu", "gpu"):
        screens[name].render(values)
    for part in screens["cpu"].head.parts:
        ids = np.arange(0, len(part.vertices), 7)
        cpu, gpu = (screens[name].renderer.evaluator.positions(part, ids) for name in ("cpu", "gpu"))
        assert gpu == pytest.approx(cpu, abs=0.05)  # only the processor lets seams overlap


def test_on_the_graphics_processor_vertices_here_stand_still(screens: dict[str, Offscreen], head: Head) -> None:
    screen = screens["gpu"]
    before = [part.vertices.copy() for part in screen.head.parts]
    screen.render(poses(head)[1])
    assert all((part.vertices == old).all() for part, old in zip(screen.head.parts, before, strict=True))


def test_a_pose_that_stays_is_not_worked_out_again(screens: dict[str, Offscreen], head: Head) -> None:
    renderer = screens["gpu"].renderer
    renderer.pose(poses(head)[3])
    assert renderer.update() > 20_000
    revision = renderer.revision
    renderer.pose(poses(head)[3])
    assert renderer.update() == 0
    assert renderer.revision == revision


def test_auto_draws_in_software_with_the_processor(gl: None, monkeypatch: pytest.MonkeyPatch, head: Head) -> None:
    for software, name in ((True, "cpu"), (False, "gpu")):
        monkeypatch.setattr("surface.view.draw.evaluator.is_software", lambda ctx, software=software: software)
        with Offscreen(head, (32, 32)) as screen:
            assert screen.renderer.evaluator.name == name
            assert screen.ctx.info["GL_RENDERER"] in screen.renderer.evaluator.reason


def test_what_cannot_be_had(gl: None, head: Head) -> None:
    with pytest.raises(ViewError, match="BallHead has no control points") as caught:
        Offscreen(BallHead(), (32, 32), evaluator="gpu")
    assert "cpu" in caught.value.hint
    with Offscreen(BallHead(), (32, 32)) as screen:
        assert screen.renderer.evaluator.name == "cpu"
    with pytest.raises(ValueError, match=", ".join(EVALUATORS)):
        Offscreen(BallHead(), (32, 32), evaluator="abacus")
    ctx = open_context()
    info = dict(ctx.info)
    ctx.release()
    assert why_not_gpu(info, head) is None
    assert "no textures" in str(why_not_gpu(info | {"GL_MAX_VERTEX_TEXTURE_IMAGE_UNITS": 0}, head))
    assert "too small" in str(why_not_gpu(info | {"GL_MAX_TEXTURE_SIZE": 512}, head))


def rotate_by_share(points: np.ndarray, share: np.ndarray, vector: np.ndarray, pivot: np.ndarray) -> np.ndarray:
    """Each point, as the sum of half of itself and half of another, rotated by its share."""
    both = np.zeros((2 * len(points), 4), np.float32)
    both[::2, :3], both[1::2, :3] = points + 1.0, points - 1.0
    start, ids, out = 2 * np.arange(len(points) + 1), np.arange(2 * len(points)), np.empty((len(points), 3))
    place_vertices(start, ids, np.full(len(ids), 0.5), both, np.float32(share), vector, pivot, out)
    return out


def test_turned_by_share() -> None:
    points, pivot = np.array([[1.0, 5.0, 0.0], [1.0, 5.0, 0.0]]), np.array([0.0, 5.0, 0.0])
    at = rotate_by_share(points, np.array([1.0, 0.5]), np.array([0.0, np.pi / 2, 0.0]), pivot)
    assert at == pytest.approx(np.array([[0, 5, -1], [np.sqrt(0.5), 5, -np.sqrt(0.5)]]), abs=1e-9)


def test_textures_must_be_wide_enough_for_a_line_and_high_enough_for_all_weights() -> None:
    """64 weights a vertex at most, 1024 a line."""
    info = {"GL_MAX_VERTEX_TEXTURE_IMAGE_UNITS": 2, "GL_MAX_TEXTURE_SIZE": 1024}
    small, large = (
        SimpleNamespace(place_points=None, parts=[SimpleNamespace(vertices=range(k)) for k in (5, count - 5)])
        for count in (16 * 1024, 32 * 1024)
    )
    none = SimpleNamespace(place_points=None, parts=[])
    halves = SimpleNamespace(place_points=None, parts=[SimpleNamespace(vertices=range(16 * 1024))] * 2)
    assert "2047 texels" in str(why_not_gpu(info | {"GL_MAX_TEXTURE_SIZE": 2047}, halves)), (
        "one texture holds all parts"
    )
    assert why_not_gpu(info | {"GL_MAX_TEXTURE_SIZE": 2048}, halves) is None
    assert why_not_gpu(info, small) is why_not_gpu(info, none) is None
    assert "1023 texels" in str(why_not_gpu(info | {"GL_MAX_TEXTURE_SIZE": 1023}, none))
    assert "2047 texels" in str(why_not_gpu(info | {"GL_MAX_TEXTURE_SIZE": 2047}, large))
    assert why_not_gpu(info | {"GL_MAX_TEXTURE_SIZE": 2048}, large) is None
    assert "no textures" in str(why_not_gpu(info | {"GL_MAX_VERTEX_TEXTURE_IMAGE_UNITS": 1}, small))


def test_no_rotation_and_half_a_turn_by_share() -> None:
    points, pivot = np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 3.0]]), np.array([0.0, 2.0, 0.0])
    assert rotate_by_share(points, np.ones(2), np.zeros(3), pivot) == pytest.approx(points)
    turned = rotate_by_share(points, np.array([0.0, 1.0]), np.array([np.pi, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    assert turned == pytest.approx(np.array([[1, 2, 3], [1, 0, -3]]), abs=1e-9)
    askew = rotate_by_share(points, np.ones(2), 2 * np.pi / 3 * np.ones(3) / np.sqrt(3), np.zeros(3))
    assert askew == pytest.approx(points[:, [2, 0, 1]], abs=1e-9)
