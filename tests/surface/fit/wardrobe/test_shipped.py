"""Shipped garments on the shipped head: where hair lies on the skin, and where none may lie."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from surface.base.arrays import Floats
from surface.head import Head
from surface.head.model.look import Look, Worn
from surface.head.posing.part import HeadPart

EAR_X, EAR_Y, EAR_Z = 76.0, (-20.0, 32.0), (-20.0, 8.0)
"""A box in an ear, from its lobe to below the top of its rim and from behind its front edge, mm."""


class Dressed:
    """Vertices (m, 3) of hair or a beard on the head, their u and v (m, 2), cover (m,) and mm from the skin (m,)."""

    def __init__(self, root: Path, garment: str) -> None:
        folder, file = root / "configs/heads/ict", root / "configs/wardrobe" / f"{garment}.npz"
        head = Head.load(folder, look=Look(worn=(Worn(file, (0.1, 0.1, 0.1)),)))
        part, bare = head.part(garment.partition("-")[0]), Head.load(folder)
        self.at, self.uv = part.vertices.astype(float), part.uv
        self.cover = part.attributes["strands"][:, 2]
        self.away = cKDTree(np.vstack([_dense(bare, name) for name in ("face", "back")])).query(self.at)[0]


def _dense(head: Head, name: str) -> Floats:
    """Vertices of a part, and the middles of its triangles and their edges."""
    part = head.part(name)
    a, b, c = part.vertices[part.triangles].astype(float).swapaxes(0, 1)
    return np.vstack([part.vertices, (a + b + c) / 3, (a + b) / 2, (b + c) / 2, (c + a) / 2])


@pytest.fixture(scope="module", params=["hair-bun", "hair-short", "hair-swept", "hair-thin"])
def hair(request: pytest.FixtureRequest, root: Path) -> Dressed:
    return Dressed(root, request.param)


def test_no_hair_lies_over_an_ear(hair: Dressed) -> None:
    x, y, z = np.abs(hair.at[:, 0]), hair.at[:, 1], hair.at[:, 2]
    inside = (x > EAR_X) & (EAR_Y[0] < y) & (y < EAR_Y[1]) & (EAR_Z[0] < z) & (z < EAR_Z[1])
    assert not (inside & (hair.cover > 0.0)).any(), hair.at[inside & (hair.cover > 0.0)]


def test_thin_hair_over_the_forehead_ends_on_the_skin(root: Path) -> None:
    """Seen from the side it stood in the air; strands that are few there must not be far from the skin."""
    thin = Dressed(root, "hair-thin")
    front = (np.abs(thin.at[:, 0]) < 12.0) & (thin.at[:, 2] > 60.0)
    ends, few = front & (thin.uv[:, 1] > 0.99), front & (thin.cover < 0.3)
    assert ends.any() and thin.away[ends].max() < 1.7
    assert few.any() and thin.away[few].max() < 4.0


def test_beards_lie_close_to_the_skin_at_the_ears(root: Path) -> None:
    beard = Dressed(root, "beard-full")
    side = (np.degrees(np.arctan2(np.abs(beard.at[:, 0]), beard.at[:, 2] - 20.0)) > 78.0) & (beard.cover > -0.25)
    assert side.any() and beard.away[side].max() < 3.0


POSES = {
    "rest": {}, "open": {"jawOpen": 1.0}, "smile": {"mouthSmileLeft": 1.0, "mouthSmileRight": 1.0},
    "pucker": {"mouthPucker": 1.0}, "funnel": {"mouthFunnel": 1.0}, "rolled": {"mouthRollUpper": 1.0},
    "laugh": {"jawOpen": 0.7, "mouthSmileLeft": 1.0, "mouthSmileRight": 1.0}, "aside": {"mouthLeft": 1.0},
}  # fmt: skip


@pytest.fixture(scope="module", params=["beard-full", "beard-short"])
def bearded(request: pytest.FixtureRequest, root: Path) -> Head:
    worn = Worn(root / "configs/wardrobe" / f"{request.param}.npz", (0.1, 0.1, 0.1))
    return Head.load(root / "configs/heads/ict", look=Look(worn=(worn,)))


def _moustache(head: Head) -> tuple[NDArray[np.bool_], HeadPart]:
    """Which vertices of the beard are of the hairs over the lip that show."""
    beard = head.part("beard")
    patch = np.floor(np.asarray(beard.uv)[:, 0] / 2.0).astype(int)
    return (patch % 2 == 1) & (beard.attributes["strands"][:, 2] > 0.3), beard


def test_a_moustache_leaves_the_lips_free_and_joins_the_beard(bearded: Head) -> None:
    shows, beard = _moustache(bearded)
    face = bearded.part("face")
    at = beard.vertices.astype(float)
    lips = face.attributes["lips"][cKDTree(face.vertices).query(at[shows])[1], 0]
    assert (lips < 0.5).mean() > 0.97
    grows = cKDTree(at[beard.attributes["strands"][:, 2] > 0.3])
    for side in (1.0, -1.0):
        way = np.array([(side * x, y) for x, y in ((20, -22), (26, -25), (31, -29), (34, -34), (36, -40), (36, -48))])
        _, near = cKDTree(face.vertices[:, :2]).query(way)
        assert grows.query(face.vertices[near])[0].max() < 6.0, "there is a gap between moustache and beard"


@pytest.mark.parametrize("pose", POSES)
def test_a_moustache_follows_the_lips(bearded: Head, pose: str) -> None:
    """It neither goes through them nor stands off, however the mouth moves."""
    shows, beard = _moustache(bearded)
    bearded.pose(bearded.values(POSES[pose]))
    face = bearded.part("face")
    away, near = cKDTree(face.vertices).query(beard.vertices[shows].astype(float))
    height = ((beard.vertices[shows] - face.vertices[near]) * face.normals[near]).sum(axis=1)
    bearded.pose(bearded.values({}))
    assert away.max() < 6.0 and height.min() > -0.6


def test_tied_hair_begins_close_to_the_ear(root: Path) -> None:
    """A strip of bare skin lay above and behind it."""
    hair = Dressed(root, "hair-bun")
    beside = np.array([(80, 42, 10), (80, 42, 0), (79, 38, -10), (76, 26, -20), (72, 10, -26)], float)
    for side in (1.0, -1.0):
        assert cKDTree(hair.at[hair.cover > 0.0]).query(beside * [side, 1.0, 1.0])[0].max() < 5.0


def test_hair_of_both_sides_meets_at_the_parting(root: Path) -> None:
    """Else there is a slot between them, in which one sees steps of what lies below."""
    look = Look(worn=(Worn(root / "configs/wardrobe/hair-long.npz", (0.1, 0.1, 0.1)),))
    part = Head.load(root / "configs/heads/ict", look=look).part("tresses")
    u, v = part.uv.T
    every = [part.vertices[(v < 1e-6) & (np.abs(u - 2.0 * k - 0.5) < 0.6)].astype(float) for k in range(6)]
    for one, other in zip(every[::2], every[1::2], strict=True):
        assert len(one) == len(other) > 40
        assert cKDTree(other).query(one)[0].max() < 0.3


def test_ears_do_not_have_the_colour_of_hair(root: Path) -> None:
    """Pictures of what hair does to the skin are made by directions from the skull's middle, in which ears lie, too."""
    worn = Worn(root / "configs/wardrobe/hair-bun.npz", (0.9, 0.0, 0.9))
    plain, dressed = (Head.load(root / "configs/heads/ict", look=look) for look in (None, Look(worn=(worn,))))
    x, y, _ = plain.part("face").vertices.T
    ear = (np.abs(x) > 87.0) & (y > -20.0) & (y < 40.0)
    assert ear.sum() > 50
    before, after = (head.part("face").attributes["albedo"][ear] for head in (plain, dressed))
    assert np.abs(after - before).max() < 0.02
