"""surface.view.draw.decimated_draw"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from surface.head import Head
from surface.head.model.look import Look
from surface.view import THEMES, Camera, Offscreen
from surface.view.draw import decimated_draw, materials
from surface.view.draw.decimated_draw import DrawCall, JoinedParts

SIZE = (320, 240)


@pytest.fixture(scope="module")
def head(root: Path) -> Head:
    return Head.load(root / "configs" / "heads" / "ict")


@pytest.fixture(scope="module")
def screen(gl: None, head: Head) -> Iterator[Offscreen]:
    with Offscreen(head, SIZE, quality="fast") as made:
        made.draw(np.zeros(len(head.parameters)))
        yield made


@pytest.mark.slow
def test_the_picture_is_that_of_the_lean_triangles_drawn_part_by_part(screen: Offscreen, root: Path) -> None:
    plain = Head.load(root / "configs" / "heads" / "ict")
    for part in plain.parts:
        part.triangles, part.decimated = part.decimated["fast"], {}
    random = np.random.default_rng(3)
    with Offscreen(plain, SIZE, quality="fast") as other:
        other.renderer.openings = screen.renderer.openings  # the rim of fewer triangles is another
        for camera in (Camera.front(), Camera.three_quarter()):
            values = random.uniform(-0.3, 0.7, len(plain.parameters))
            screen.draw(values, camera)
            other.draw(values, camera)
            off = np.abs(screen.read().astype(int) - other.read()).max(axis=2)  # cells are summed in another order
            assert (off > 2).mean() < 3e-3


def test_what_does_not_move_is_not_sent(screen: Offscreen, head: Head) -> None:
    renderer = screen.renderer
    sent = []
    for given in ({}, {"jawOpen": 0.2}, {"jawOpen": 0.2}, {"jawOpen": 0.2, "rightEyeYaw": 0.5}):
        renderer.pose(head.values(given))
        sent.append(renderer.update())
    eye = next(p for p in renderer.evaluator.decimated.parts if p.part.name == "eye_right")  # type: ignore[attr-defined]
    assert sent[1] > len(eye.kept) and sent[2] == 0
    assert sent[3] >= len(eye.kept), "the eye, and lids that follow it"


@pytest.mark.parametrize(
    ("given", "camera", "drawn"),
    [
        ({}, Camera.front(), False),
        ({"mouthPressLeft": 0.8, "mouthPressRight": 0.8, "headYaw": 0.4}, Camera.three_quarter(), False),
        ({"jawOpen": 0.3}, Camera.front(), True),
        ({"mouthFunnel": 0.6}, Camera.three_quarter(), True),
        ({}, Camera.around(0.0, -40.0), True),
    ],
)
def test_teeth_are_drawn_where_they_may_be_seen(
    screen: Offscreen, head: Head, monkeypatch: pytest.MonkeyPatch, given: dict[str, float], camera: Camera, drawn: bool
) -> None:
    draw, names = screen.renderer._draw_part, []

    def note(buffers: Any, *, multisampled: bool) -> None:
        names.append(buffers.part.material)
        draw(buffers, multisampled=multisampled)

    monkeypatch.setattr(screen.renderer, "_draw_part", note)
    screen.target._shown = None  # else a picture equal to the last one is not drawn again
    screen.draw(head.values(given), camera)
    assert ("teeth" in names, "gums" in names) == (drawn, drawn)
    assert "mouth" in names and "tongue" in names


def test_closed_lips_hide_teeth(screen: Offscreen, head: Head, monkeypatch: pytest.MonkeyPatch) -> None:
    given = head.values({"mouthRollUpper": 0.5, "headYaw": 0.3})
    screen.draw(given)
    without = screen.read().astype(int)
    monkeypatch.setattr(materials, "BEHIND_LIPS", ())
    screen.target._shown = None  # else an equal picture is not drawn again
    screen.draw(given)
    off = np.abs(screen.read() - without).max(axis=2) > 8
    assert off.mean() < 2e-4, "but for specks of teeth between the lips"


def test_a_display_and_a_mouth_without_lining_hide_nothing(
    screen: Offscreen, head: Head, monkeypatch: pytest.MonkeyPatch
) -> None:
    renderer = screen.renderer
    screen.draw(head.values({}), Camera.front())
    assert renderer._lips_hide()
    with monkeypatch.context() as patch:
        patch.setattr(renderer, "theme", THEMES["robot"])
        assert not renderer._lips_hide()
    monkeypatch.setattr(renderer, "_lined", False)
    assert not renderer._lips_hide()


def test_positions_are_those_of_the_head(screen: Offscreen, head: Head) -> None:
    values = head.values({"jawOpen": 0.6, "headYaw": -0.4, "eyeBlinkLeft": 1.0})
    screen.draw(values)
    head.pose(values)
    for name, ids in screen.renderer.openings.read_vertices().items():
        found = screen.renderer.evaluator.positions(head.part(name), ids)
        # mm: seams overlap beside lines of fewer vertices
        np.testing.assert_allclose(found, head.part(name).vertices[ids], rtol=0, atol=0.01)


def test_the_head_poses_as_before_whatever_is_drawn(screen: Offscreen, head: Head) -> None:
    values = head.values({"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0, "mouthRollLower": 0.5})
    head.pose(values)
    before = {part.name: part.vertices.copy() for part in head.parts}
    screen.draw(head.values({"eyeWideLeft": 1.0, "eyeLookDownRight": 1.0, "mouthClose": 0.5}))
    head.pose(values)
    for part in head.parts:
        assert np.array_equal(part.vertices, before[part.name]), part.name


def test_parts_that_are_joined_tell_what_changed_by_their_place_in_the_joined_rows(screen: Offscreen) -> None:
    decimated = screen.renderer.evaluator.decimated  # type: ignore[attr-defined]
    parts = decimated.parts[2:4]
    joined = JoinedParts(decimated, parts)
    start, second = parts[0].first, parts[1].first - parts[0].first
    assert start > 0 and second == len(parts[0].kept)
    assert len(joined.vertices) == len(joined.normals) == parts[1].last - start
    for rows, whole in ((joined.vertices, decimated.vertices), (joined.normals, decimated.normals)):
        assert np.array_equal(rows, whole[start : parts[1].last])
    assert np.array_equal(joined.triangles[len(parts[0].triangles) :], parts[1].triangles + second)
    parts[0].changed, parts[1].changed = [(1, 4)], [(0, 2), (5, 6)]
    assert joined.changed == [(1, 4), (second, second + 2), (second + 5, second + 6)]
    assert (joined.name, joined.material) == (parts[0].part.name, parts[0].part.material)


def test_shared_buffers_are_sent_and_released_by_one_draw_call() -> None:
    done: list[str] = []
    triangles = np.arange(30).reshape(10, 3)
    buffers: Any = SimpleNamespace(
        triangles=triangles, upload=lambda: done.append("upload") or 7, release=lambda: done.append("release")
    )
    parts: list[Any] = [SimpleNamespace(part=name, triangles=triangles[:3]) for name in ("left", "right")]
    owner, other = DrawCall(buffers, parts, 0, owner=True), DrawCall(buffers, parts[1:], 6, owner=False)
    assert (owner.upload(), other.upload()) == (7, 0)
    other.release()
    assert done == ["upload"]
    owner.release()
    assert done == ["upload", "release"]
    assert np.array_equal(owner.triangles, triangles[:6]) and np.array_equal(other.triangles, triangles[6:9])


def test_one_draw_call_owns_the_buffers_also_where_clothes_hide_its_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    triangles = np.arange(30).reshape(10, 3)
    made: list[Any] = []

    def buffers(*_: object) -> Any:
        made.append(SimpleNamespace(triangles=triangles))
        return made[-1]

    monkeypatch.setattr(decimated_draw, "PartBuffers", buffers)
    monkeypatch.setattr(decimated_draw, "JoinedParts", lambda *_: None)
    monkeypatch.setattr(decimated_draw.materials, "material_of", lambda name: SimpleNamespace(program="skin"))
    monkeypatch.setattr(decimated_draw.materials, "uniforms_key", lambda part: part.name)
    hidden, shown, last = (
        SimpleNamespace(part=SimpleNamespace(name=name, material="skin"), triangles=triangles[:count], kept=[0])
        for name, count in (("hidden", 0), ("shown", 4), ("last", 6))
    )
    head: Any = SimpleNamespace(parts=[hidden, shown, last])
    calls = decimated_draw.draw_calls(
        SimpleNamespace(), head, {"skin": SimpleNamespace()}, lambda part: {"uv": np.zeros((1, 2))}
    )  # type: ignore[arg-type, dict-item]
    assert len(made) == 1
    assert [call._owner for call in calls] == [True, False, False]
    assert [len(call.triangles) for call in calls] == [0, 4, 6]


@pytest.mark.slow
def test_freckles_of_live_pictures_are_about_as_many_as_those_of_stills(gl: None, root: Path) -> None:
    darker = {}
    for freckles in (0.0, 0.9):
        freckled = Head.load(root / "configs" / "heads" / "ict", look=Look(freckles=freckles))
        for samples in (None, 1):  # None: live, and drawn in software with fewer triangles and without filters
            with Offscreen(freckled, (960, 720), samples=samples) as made:
                made.draw(np.zeros(len(freckled.parameters)), Camera.front())
                darker[freckles, samples] = made.read()[250:480, 280:680].astype(float)
    live, still = ((darker[0.0, samples] - darker[0.9, samples]).mean() for samples in (None, 1))
    assert 0.02 < still < 2.0, "freckles are few and seen"
    assert 0.5 < live / still < 2.0
