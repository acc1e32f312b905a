"""Distances from a scan to a head: known offsets come out, and what is no face does not count."""

from types import SimpleNamespace

import made_face
import numpy as np
import pytest
from small_head import small_head

from surface.fit.transfer.reports import distances as distances_module
from surface.fit.transfer.reports import errors as module
from surface.fit.transfer.reports.errors import FaceErrors, distances, face_errors
from surface.fit.transfer.scan import Samples
from surface.head import Head

Z = np.array([0.0, 0.0, 1.0])
FRONT = np.array([[x, y, -5.0 + 65 * ((x + y) % 20 > 0)] for x in range(-40, 41, 5) for y in range(-50, 51, 5)])


@pytest.fixture(autouse=True)
def few(monkeypatch):
    monkeypatch.setattr(distances_module, "COUNT", 20_000)


def wall(name="face", material="skin", z=0.0, follows="skin"):
    corners = np.array([[-60, -60, z], [60, -60, z], [60, 60, z], [-60, 60, z]])
    return SimpleNamespace(name=name, material=material, follows=follows, vertices=corners.astype(np.float32),
                           triangles=np.array([[0, 1, 2], [0, 2, 3]], np.int32))  # fmt: skip


def head(*parts):
    return SimpleNamespace(name="x", parts=parts or (wall(),))


def scan(z, count=400, normal=Z, border=False, size=(38.0, 48.0)) -> Samples:
    at = np.random.default_rng(0).uniform(-1, 1, (count, 2)) * size
    return Samples(np.column_stack([at, np.full(count, z)]), np.tile(normal, (count, 1)), np.full(count, border))


def measured(*given) -> np.ndarray:
    return distances(*given)[1]


def together(*every: Samples) -> Samples:
    return Samples(*(np.concatenate([getattr(s, k) for s in every]) for k in ("points", "normals", "border")))


@pytest.mark.parametrize("z", [-1.5, 0.0, 0.75, 1.9, 3.0, 15.0])
def test_the_distance_is_that_along_the_normal_near_the_surface(z: float) -> None:
    found = measured(head(), FRONT, scan(z))
    assert len(found) == 400
    np.testing.assert_allclose(found, abs(z), atol=1e-9 if abs(z) < 1.8 else 0.4)


def test_what_is_far_away_beside_behind_or_at_a_border_does_not_count() -> None:
    base = scan(1.0, 100)
    for other in (
        scan(1.0, 50, border=True), scan(1.0, 50, size=(0, 48)).__class__(
            scan(1.0, 50).points + np.array([100, 0, 0]), scan(1.0, 50).normals, scan(1.0, 50).border),
        scan(1.0, 50, normal=np.array([0.98, 0.0, 0.1])), scan(0.5, 50, normal=np.array([0.9, 0.0, 0.3])),
    ):  # fmt: skip
        np.testing.assert_allclose(measured(head(), FRONT, together(base, other)), np.ones(100), atol=1e-9)
    behind = scan(-9.0, 50)
    hidden = Samples(np.column_stack([base.points[:50, :2], behind.points[:, 2]]), behind.normals, behind.border)
    deep = np.vstack([FRONT, [[0, 0, -20]]])
    np.testing.assert_allclose(measured(head(), deep, together(base, hidden)), np.ones(100), atol=1e-9)


def test_a_face_may_stand_out_before_the_front_by_so_much() -> None:
    assert len(measured(head(wall(z=61.0)), FRONT, scan(70.0))) == 400
    assert len(measured(head(wall(z=61.0)), FRONT, scan(79.0))) == 400
    assert not len(measured(head(wall(z=61.0)), FRONT, scan(80.5)))


def test_what_lies_further_off_than_a_face_is_hair_or_clothes() -> None:
    assert len(measured(head(), FRONT, scan(19.0))) == 400 and not len(measured(head(), FRONT, scan(21.0)))


def test_skin_and_eyes_are_measured_and_no_other_parts() -> None:
    parts = wall(), wall("eye", "eye", 6.0, "left_eye"), wall("hair", "hair", 3.0)
    np.testing.assert_allclose(measured(head(*parts), FRONT, scan(6.0)), 0.0, atol=1e-9)
    np.testing.assert_allclose(measured(head(*parts), FRONT, scan(3.0)), 3.0, atol=0.4)


def test_ears_and_crowns_beside_the_front_do_not_count() -> None:
    front = FRONT[np.abs(FRONT[:, 0]) < 21]
    wide = np.vstack([front, [[-40.0, 50, 0], [40, 50, 0]]])  # the box around it is wider than the face
    at, _ = distances(head(), wide, scan(1.0, 4000))
    beside = np.abs(at[:, 0]) > 27
    assert len(at) > 1500 and (at[beside, 1] > 43).all() and not beside.all()


def test_a_report_has_rms_most_and_the_hundredth_part_of_skin_and_of_eyes(monkeypatch) -> None:
    off = np.linspace(0.0, 2.0, 1001)
    at = np.column_stack([np.full(1001, 60.0), np.zeros(1001), np.zeros(1001)])
    eyes = np.array([[30.0, 30, 60], [-30, 30, 60]])
    data = SimpleNamespace(parts=[SimpleNamespace(points=np.zeros((k, 3))) for k in (4, 5)], eyes=eyes, eye_radius=12.0)
    heard = []
    inner = np.vstack([at, [[30.0, 48, 90], [-30, 50, 90]]])  # 18 mm from the left eye's axis, 20 from the right one's
    every = np.append(off, [5.0, 1.0])
    monkeypatch.setattr(module, "Head", lambda d: d)
    monkeypatch.setattr(module, "distances", lambda h, front, s: heard.append(front) or (inner, every))
    face = made_face.template()
    found = face_errors(data, face, lambda p: p + 1.0, scan(0.0))
    skin, lids = found.parts
    assert (skin.name, skin.points, skin.samples) == ("face", 9, 1002)
    assert (lids.name, lids.points, lids.samples, lids.neutral.max) == ("eyes and lids", 0, 1, 5.0)
    own = np.append(off, 1.0)
    assert skin.neutral.rms == pytest.approx(np.sqrt((own**2).mean())) and skin.neutral.max == 2.0
    assert skin.neutral.p99 == pytest.approx(1.98, abs=0.002)
    assert [(name, mm) for name, mm, _ in found.greatest] == [("face", 2.0), ("eyes and lids", 5.0)]
    np.testing.assert_allclose([place for *_, place in found.greatest], [at[0], [30.0, 48, 90]])
    assert heard[0][:, 1].max() == pytest.approx(1 + face.points[module.face_region(face)][:, 1].max())
    monkeypatch.setattr(module, "distances", lambda *_: (np.zeros((0, 3)), np.zeros(0)))
    nothing = face_errors(data, face, lambda p: p, scan(0.0))
    assert not nothing.parts[0].neutral.measured and not nothing.greatest


def test_the_greatest_distances_are_told_with_their_places() -> None:
    data = small_head()
    spots = [("face", 1.234, data.eyes[0] + [0.0, -2.0, 0.0]), ("eyes and lids", 2.5, data.eyes[1])]
    head = Head(data)
    rest = [part.vertices.copy() for part in head.parts]
    head.pose(head.values({"jawOpen": 1.0}))
    skin, lids = FaceErrors([], spots).lines(head)
    assert all((part.vertices == before).all() for part, before in zip(head.parts, rest, strict=True))  # at rest again
    assert skin == "greatest error 1.23 mm: left eye (face, mesh to surface)"
    assert lids.startswith(
        "greatest error 2.50 mm: right eye (eyes and lids, mesh to surface); eyes and lids: eyeballs"
    )
