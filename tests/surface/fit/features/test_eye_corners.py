"""Flesh between lids and eyeballs."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from surface.fit.features.eye_corners import NAME, corners_part, lacks_corners
from surface.head import Head

SHAPES = ({}, {"eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0}, {"jawOpen": 1.0})


@pytest.mark.slow
@pytest.mark.parametrize("pose", SHAPES)
def test_it_hangs_on_the_rim_in_every_shape_and_ends_in_the_eyeball(head: Head, pose: dict[str, float]) -> None:
    """Where a seam is sewn, vertices of both parts are one; the far border is nowhere to be seen."""
    seams = [s for s in head.data.seams if s.part_b == NAME]
    assert len(seams) == 2
    head.pose(head.values(pose))
    part, face = head.part(NAME), head.part("face")
    rest = part.vertices.astype(float)
    posed = face.surface.with_points(face.control_points)
    t = np.linspace(0.0, 1.0, 16, endpoint=False)[:, None, None]
    dense = [((1.0 - t) * uv[:-1] + t * uv[1:]).reshape(-1, 2) for uv in (s.uv_a for s in seams)]
    rims = posed.evaluate(np.concatenate(dense))
    sewn = part.uv[:, 1] < 1e-5
    off = cKDTree(rims[np.isfinite(rims).all(axis=1)]).query(rest[sewn])[0]
    assert sewn.sum() > 40 and off.max() < 0.4
    away = np.linalg.norm(rest[:, None] - head.data.eyes, axis=2).min(axis=1)
    end = part.uv[:, 1] > 1.0 - 1e-5
    assert end.sum() > 40 and (away[end] < head.data.eye_radius).all()
    head.pose(head.values({}))


@pytest.mark.slow
def test_it_is_seen_from_the_front(head: Head) -> None:
    head.pose(head.values({}))
    part = head.part(NAME)
    eye = head.data.eyes[(part.vertices[:, 0] < 0).astype(int)]
    inwards = eye - part.vertices
    inwards[:, 2] = np.abs(inwards[:, 2])
    assert (part.normals * inwards).sum(axis=1).mean() > 0


@pytest.mark.slow
def test_it_is_painted_as_flesh(head: Head) -> None:
    assert [p["attribute"] for p in head.data.paint if p["part"] == NAME][-1] == "albedo"
    red, green, _ = head.part(NAME).attributes["albedo"].mean(axis=0)
    assert red > 2.0 * green


@pytest.mark.parametrize(
    ("exported", "pieces", "made"),
    [(False, ("Head", "eyes"), True), (True, ("face/skin", "lids/wet"), False), (True, ("eye_corners/skin",), True)],
)
def test_exports_get_them_again_only_where_they_had_them(exported: bool, pieces: tuple[str, ...], made: bool) -> None:
    kinds = dict.fromkeys(pieces, "skin")
    assert lacks_corners(SimpleNamespace(exported=exported, pieces=kinds)) is made  # type: ignore[arg-type]


def test_a_face_without_openings_has_none() -> None:
    chart, fitted = (
        SimpleNamespace(loops=[np.zeros((4, 2))]),
        SimpleNamespace(net=None, points=np.zeros((1, 3)), moves=np.zeros((0, 1, 3))),
    )
    rig = SimpleNamespace(eyes=np.zeros((2, 3)), radius=12.0)
    assert corners_part("face", chart, fitted, None, rig, 1.0) is None  # type: ignore[arg-type]
