"""Flesh between lids and eyeballs."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from eye_face import CENTRES, disc, face, joined, pair, shell
from scipy.spatial import cKDTree

from surface.fit.eyes.names import is_cover
from surface.fit.eyes.search import find_eyes
from surface.fit.features.eye_corners import FLESH, NAME, corners_paint, corners_part, lacks_corners
from surface.fit.source.mesh import FitMesh
from surface.head import Head
from surface.head.posing.paint import BASE
from surface.readers.meshdata import Material

PATCHES = (("White", 11.0, 9.0), ("Iris", 11.5, 4.0))  # of flat eyes: their names, places before the centre and radii
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
def test_it_is_painted_as_flesh_that_shade_does_not_darken(head: Head) -> None:
    assert [p["attribute"] for p in head.data.paint if p["part"] == NAME][-2:] == ["albedo", "occlusion_floor"]
    own, skin = (head.part(n).attributes.get("albedo", np.array([BASE["albedo"]])).mean(axis=0) for n in (NAME, "face"))
    assert own[0] / own[1] > 1.2 * skin[0] / skin[1] and own[1] > 0.6 * skin[1]
    assert (head.part(NAME).attributes["occlusion_floor"] > 0.5).all()


def albedo(mesh: FitMesh) -> list[float]:
    found = find_eyes(mesh, lambda gone: ~gone)
    (layer,) = (p for p in corners_paint(mesh, found) if p["attribute"] == "albedo")
    assert layer["part"] == NAME
    value = layer["value"]
    assert isinstance(value, list)
    return value


def test_flat_eyes_have_white_in_their_corners_and_balls_flesh() -> None:
    """A drawn character's are patches: red beside them would be a spot that nobody drew."""
    white, brown = Material("white", (0.8, 0.7, 0.6, 1.0)), Material("brown", (0.2, 0.1, 0.05, 1.0))
    patches = [
        (f"Eye{w}_{s}", disc(c + np.array([0, 0, z]), r))
        for s, c in zip("LR", CENTRES, strict=True)
        for w, z, r in PATCHES
    ]
    flat = joined([("Head", face()), *patches])
    coloured = replace(flat, materials=(None, white, brown, white, brown))
    np.testing.assert_allclose(albedo(coloured), [0.8, 0.7, 0.6], atol=1e-3)
    assert albedo(flat) == list(BASE["sclera"])  # no colours are known
    balls = joined([("Head", face()), *pair(shell)])
    assert albedo(replace(balls, materials=(None, white, white))) == FLESH


def test_an_export_s_bands_keep_their_colour() -> None:
    own = Material("painted", (0.3, 0.2, 0.1, 1.0))
    mesh = joined([("Head", face()), *pair(shell), (f"{NAME}/painted", disc(CENTRES[0] + np.array([0, 0, 11.0]), 9.0))])
    np.testing.assert_allclose(albedo(replace(mesh, materials=(None, None, None, own))), [0.3, 0.2, 0.1], atol=1e-3)
    assert is_cover(f"{NAME}/skin_painted")  # it says nothing of the eyeballs


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
