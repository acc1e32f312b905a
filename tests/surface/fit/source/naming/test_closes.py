"""A mouthClose that is made from jawOpen."""

from dataclasses import replace

import numpy as np
import pytest

from surface.fit.source.mesh import FitMesh
from surface.fit.source.naming.closes import made_close
from surface.fit.source.naming.misnamed import closing

LIPS, CHIN = -40.0, -80.0  # y, mm


def grid(low: float, high: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices of a sheet between two heights, and its faces."""
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(-50.0, 50.0, 41), np.linspace(low, high, count)))
    at = np.arange(41 * count).reshape(count, 41)
    faces = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1).reshape(-1, 4)
    return np.column_stack([x, y, 90.0 - 0.01 * x**2]), faces


def mouth(*, upper: float = 0.0, chin: float = 1.0, torn: bool = True) -> FitMesh:
    """A sheet above and one below the lips, and teeth; jawOpen takes the lower one 20 mm down, ``upper`` mm of it up at
    the upper lip; ``chin`` : share of the lower lip's motion that the chin has."""
    above, faces_above = grid(LIPS + (0.3 if torn else 0.0), 40.0, 33)
    below, faces_below = grid(CHIN, LIPS, 25)
    teeth, faces_teeth = grid(LIPS - 8.0, LIPS - 1.0, 5)
    vertices = np.concatenate([above, below, teeth - [0.0, 0.0, 6.0]])
    starts = (0, len(above), len(above) + len(below))
    faces = np.concatenate([f + s for f, s in zip((faces_above, faces_below, faces_teeth), starts, strict=True)])
    piece = np.repeat([0, 0, 1], [len(faces_above), len(faces_below), len(faces_teeth)])
    move = np.zeros_like(vertices)
    y = vertices[:, 1]
    corner = np.clip(1.0 - np.abs(vertices[:, 0]) / 30.0, 0.0, 1.0)
    down = np.interp(y, [CHIN, LIPS], [chin, 1.0]) * (corner if torn else 1.0)
    move[starts[1] :, 1] = -20.0 * down[starts[1] :]
    move[: starts[1], 1] = upper * np.exp(-(((y[: starts[1]] - LIPS) / 10.0) ** 2)) * corner[: starts[1]]
    if not torn:
        move[:, 1] = -20.0 * np.clip((40.0 - y) / 120.0, 0.0, 1.0)
    uv = np.zeros((len(vertices), 2))
    return FitMesh(vertices, faces, uv, faces.copy(), ("jawOpen",), move[None], piece, ("Head/Skin", "Teeth"))


def gap(mesh: FitMesh, close: np.ndarray) -> float:
    """How far the lips are apart in the middle with the jaw open and the mouth closed, mm."""
    at = mesh.vertices + mesh.deltas[0] + close
    middle = np.abs(mesh.vertices[:, 0]) < 1.0
    skin = np.arange(len(at)) < 41 * 58
    low = middle & skin & (mesh.vertices[:, 1] == LIPS)
    high = middle & skin & (mesh.vertices[:, 1] == LIPS + 0.3)
    return float(at[high, 1].min() - at[low, 1].max())


@pytest.mark.parametrize(("upper", "chin"), [(0.0, 1.0), (6.0, 0.0)], ids=["a jaw", "a vowel of a drawn mouth"])
def test_lips_meet_over_the_open_jaw_and_the_chin_stays_down(upper: float, chin: float) -> None:
    mesh = mouth(upper=upper, chin=chin)
    close = made_close(mesh)
    assert close is not None
    assert gap(mesh, np.zeros_like(close)) > 20.0 and gap(mesh, close) == pytest.approx(0.3, abs=0.4)
    lowest = (mesh.vertices[:, 1] == CHIN) & (np.abs(mesh.vertices[:, 0]) < 1.0)
    assert np.abs(close[lowest]).max() < 0.3 * 20.0


def test_teeth_stay_with_the_jaw() -> None:
    mesh = mouth()
    close = made_close(mesh)
    assert close is not None and not close[41 * 58 :].any()


def test_a_face_that_the_jaw_does_not_tear_has_no_lips_to_close() -> None:
    assert made_close(mouth(torn=False)) is None
    assert made_close(replace(mouth(), names=("mouthPucker",))) is None
    assert made_close(replace(mouth(), deltas=np.zeros_like(mouth().deltas))) is None


def test_a_missing_or_idle_mouth_close_is_made_and_said() -> None:
    mesh = mouth()
    made, notes = closing(mesh)
    assert made.names == ("jawOpen", "mouthClose") and notes == ["mouthClose: made from jawOpen: the mesh has none"]
    idle = replace(mesh, names=("mouthClose", "jawOpen"), deltas=np.concatenate([0.04 * mesh.deltas, mesh.deltas]))
    made, notes = closing(idle)
    assert made.names == ("jawOpen", "mouthClose")
    why = "that of the mesh moves the lips by 0.8 mm, and closes no jaw that opens by 20.0 mm"
    assert notes == [f"mouthClose: made from jawOpen: {why}"]
    assert gap(mesh, made.deltas[1]) == pytest.approx(0.3, abs=0.4)


def test_one_that_closes_the_mouth_stays_as_it_is() -> None:
    mesh = mouth()
    own = replace(mesh, names=("jawOpen", "mouthClose"), deltas=np.concatenate([mesh.deltas, -0.8 * mesh.deltas]))
    assert closing(own) == (own, [])
