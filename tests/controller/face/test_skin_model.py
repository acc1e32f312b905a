"""controller.face.skin_model: where points of the skin are in a picture, against the head that is drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.base.paths import find_config
from controller.face import skin_model as module
from controller.face.skin_model import Screen, SkinModel, SkinModels, head_rotation
from surface.head import Head
from surface.head.model.parameters import NAMES, rotation
from surface.view.scene.camera import Camera

SIZE = (640.0, 360.0)
TURNED = {"headYaw": 0.4, "headPitch": -0.3, "headRoll": 0.2}
MOVED = {"jawOpen": 0.6, "mouthSmileLeft": 0.7, "browInnerUp": 0.5, "eyeBlinkRight": 1.0}


@pytest.fixture(scope="module")
def folder() -> Path:
    return find_config("heads", "ict")


@pytest.fixture(scope="module")
def head(folder: Path) -> Head:
    return Head.load(folder)


@pytest.fixture(scope="module")
def model(head: Head) -> SkinModel:
    return SkinModel(head, P)


def face(**values: float) -> np.ndarray:
    found = P.neutral()
    for name, value in values.items():
        found[P.index(name)] = value
    return found


# ---------------------------------------------------------------- pictures
def test_places_are_projected_as_the_camera_sees_them() -> None:
    camera = Camera.front()
    screen, matrix = Screen(camera, SIZE), camera.matrix(SIZE[0] / SIZE[1]).astype(np.float64)
    places = np.random.default_rng(1).uniform(-80, 80, (20, 3))
    clip = np.array([matrix @ [*place, 1.0] for place in places])
    found = screen.project(places)
    np.testing.assert_allclose(found[:, 0], (clip[:, 0] / clip[:, 3] + 1.0) * 320.0)
    np.testing.assert_allclose(found[:, 1], (1.0 - clip[:, 1] / clip[:, 3]) * 180.0)
    np.testing.assert_allclose(found[:, 2], clip[:, 3])
    right, up = screen.project(np.array([[1.0, 0, 0], [0, 1.0, 0]])) - screen.project(np.zeros((2, 3)))
    assert right[0] > 0.0 and up[1] < 0.0  # pixels run to the right and down


def test_a_place_under_a_pixel_has_the_depth_of_the_place_beside_it() -> None:
    screen = Screen(Camera.around(35.0, -10.0), SIZE)
    rng = np.random.default_rng(2)
    for beside, pixel in zip(rng.uniform(-80, 80, (10, 3)), rng.uniform(0, 360, (10, 2)), strict=True):
        found = screen.place((float(pixel[0]), float(pixel[1])), beside)
        x, y, depth = screen.project(found[None])[0]
        assert (x, y) == pytest.approx(tuple(pixel), abs=1e-6)
        assert depth == pytest.approx(screen.project(beside[None])[0, 2])
        own = screen.project(beside[None])[0]
        np.testing.assert_allclose(screen.place((own[0], own[1]), beside), beside, atol=1e-6)


# ---------------------------------------------------------------- points of the skin
def test_samples_lie_on_the_skin_with_unit_normals_that_point_outwards(model: SkinModel, head: Head) -> None:
    part = head.part("face")
    own = part.surface.evaluate(model.skin.uv)
    np.testing.assert_allclose(model.skin.rest, own, atol=0.1)  # contacts close the lips
    np.testing.assert_allclose(np.linalg.norm(model.normals, axis=1), 1.0, atol=1e-6)
    front = model.skin.rest[:, 2] > 95.0
    assert front.sum() > 50 and model.normals[front, 2].mean() > 0.5
    assert len(model.skin.rest) == module._VERTEX_SAMPLES + module._AREA_SAMPLES
    basis = model.basis @ part.surface.points
    np.testing.assert_allclose(basis, model.skin.rest, atol=0.1)


def test_flat_skin_has_its_share_of_the_samples_by_area(head: Head) -> None:
    """Of places drawn over the area, each tenth of the height has about its share of the area."""
    head.pose(head.values({}))
    part = head.part("face")
    uv = module._sample_area(head)
    assert uv.shape == (600, 2) and np.array_equal(uv, module._sample_area(head))  # the same at every start
    a, b, c = (part.vertices[part.mesh.triangles[:, k]].astype(float) for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    height = ((a + b + c) / 3.0)[:, 1]
    order = np.argsort(height)
    edges = height[order][np.searchsorted(np.cumsum(area[order]), np.linspace(0, 1, 6)[1:-1] * area.sum())]
    found = np.histogram(part.surface.evaluate(uv)[:, 1], [-np.inf, *edges, np.inf])[0]
    assert found.min() > 120 - 45 and found.max() < 120 + 45  # of 120 each; four deviations of a fair draw


def above_neck(head: Head, rest: np.ndarray) -> np.ndarray:
    """(m,) bool: which places at rest turn with the head as a whole."""
    neck = head.data.neck
    found: np.ndarray = rest[:, 1] + neck.slope * rest[:, 2] > neck.whole
    return found


@pytest.mark.parametrize("values", [{}, MOVED, {**MOVED, **TURNED}], ids=["rest", "moved", "turned"])
def test_places_are_where_the_head_is_drawn(model: SkinModel, head: Head, values: dict[str, float]) -> None:
    """Between its triangles' corners the surface is at most their chord away."""
    part, still = head.part("face"), np.zeros((model.surface.n, 3))
    head.pose(head.values(values))
    some = np.flatnonzero(above_neck(head, part.surface.evaluate(part.mesh.uv)))[::89]
    found = model.places_of(part.mesh.uv[some], face(**values), still)
    np.testing.assert_allclose(found, part.vertices[some], atol=2e-3)


def test_moved_control_points_move_the_skin_by_their_share(model: SkinModel) -> None:
    values, moves = face(**MOVED), np.zeros((model.surface.n, 3))
    moves[200:260] = [0.5, -1.0, 2.0]
    uv = model.skin.uv[::40]
    off = model.places_of(uv, values, moves) - model.places_of(uv, values, np.zeros_like(moves))
    np.testing.assert_allclose(off, model.surface.basis_matrix(uv) @ moves, atol=1e-9)
    local = model.local(values, moves) - model.local(values, np.zeros_like(moves))
    np.testing.assert_allclose(local, model.basis @ moves, atol=1e-9)
    np.testing.assert_allclose(model.shown(values, moves), model.basis @ moves, atol=1e-9)


def test_the_head_turns_about_its_neck(model: SkinModel, head: Head) -> None:
    values = face(**TURNED)
    found, turn = model.turned(model.skin.rest, values)
    angles = np.radians([60.0, 40.0, 30.0]) * list(TURNED.values())
    np.testing.assert_allclose(turn, rotation(*angles), atol=1e-9)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    pivot = np.array(head.data.neck.pivot)
    np.testing.assert_allclose(np.linalg.norm(found - pivot, axis=1), np.linalg.norm(model.skin.rest - pivot, axis=1))
    np.testing.assert_allclose(found, (model.skin.rest - pivot) @ turn.T + pivot)
    assert np.array_equal(model.turned(model.skin.rest, P.neutral())[1], np.eye(3))


def test_turns_are_read_in_the_order_of_a_head() -> None:
    values = np.zeros(len(NAMES))
    values[[NAMES.index(name) for name in TURNED]] = list(TURNED.values())
    wanted = rotation(*(np.radians([60.0, 40.0, 30.0]) * list(TURNED.values())))
    np.testing.assert_allclose(head_rotation(values), wanted)


def test_places_under_pixels_are_those_that_are_drawn_there(model: SkinModel, head: Head) -> None:
    values, screen = face(headYaw=0.3, jawOpen=0.4), Screen(Camera.front(), SIZE)
    moves = np.zeros((model.surface.n, 3))
    for moved in (False, True):
        moves[200:260, 2] = 3.0 if moved else 0.0
        places = model.places_of(model.skin.uv, values, moves)
        facing = (model.turned(model.normals + model.pivot, values)[0] - model.pivot)[:, 2] > 0.95
        near = np.flatnonzero(facing & above_neck(head, model.skin.rest))[:15]
        pixels = screen.project(places[near])
        found = model.under(pixels[:, :2], screen, values, moves)
        seen = screen.project(model.places_of(found, values, moves))
        hidden = seen[:, 2] < pixels[:, 2] - 1.0  # something lies before it
        np.testing.assert_allclose(seen[~hidden, :2], pixels[~hidden, :2], atol=0.5)
        assert (~hidden).sum() > 8
        assert np.isnan(model.under(np.array([[1.0, 1.0]]), screen, values, moves)).all()


# ---------------------------------------------------------------- made once
def test_a_model_is_made_at_the_first_question_and_then_kept(
    head: Head, model: SkinModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "SkinModel", lambda head, parameters: model)
    loads: list[int] = []

    def load() -> Head:
        loads.append(1)
        return head

    models = SkinModels(load, P)
    assert loads == []
    first = models.make(())
    assert first is model and models.make(()) is first and loads == [1]
    assert first.with_light(()) is first
    vertices, uv = first.mesh_rest
    np.testing.assert_allclose(vertices, head.part("face").surface.evaluate(uv))
