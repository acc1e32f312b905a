"""A head as a scanner sees it, and its landmarks, on a face whose height is known at every place."""

from types import SimpleNamespace

import made_face
import numpy as np
import pytest

from surface.base.errors import FitError
from surface.fit.transfer.template import NAMES, find_landmarks, make_template
from surface.head.model.data import Neck

NECK = Neck((0.0, -55.0, -5.0))
RIMS = {"lips": ((0, -38), 22, 5), "left_lids": ((33, 36), 13, 6), "right_lids": ((-33, 36), 13, 6)}


class Surface:
    """Its (u, v) are x and y."""

    def evaluate(self, uv):
        return made_face.on_face(*np.asarray(uv).T)[0]


def contact(name: str, flipped: bool = False):
    (x, y), wide, tall = RIMS[name]
    t = np.linspace(-1, 1, 9)[:: -1 if flipped else 1]
    sides = [np.column_stack([x + wide * t, y + s * tall * (1 - t**2)]) for s in (1, -1)]
    places = np.stack(
        [np.stack([side, side + np.array([0, 3.0 * s])], axis=1) for side, s in zip(sides, (1, -1), strict=True)]
    )
    return SimpleNamespace(name=name, part="face", places=places)


def part(name, follows="skin", material="skin", shift=(0.0, 0.0, 0.0)):
    x, y = (a.ravel() for a in np.meshgrid(np.arange(-70.0, 71), np.arange(-100.0, 101), indexing="ij"))
    at = np.arange(len(x)).reshape(141, 201)
    triangles = np.stack([at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel()], axis=1).astype(np.int32)
    points, normals = made_face.on_face(x, y)
    return SimpleNamespace(name=name, follows=follows, material=material, vertices=(points + shift).astype(np.float32),
                           normals=normals.astype(np.float32), triangles=triangles, surface=Surface())  # fmt: skip


def ball(name, follows, centre):
    directions = np.random.default_rng(0).normal(size=(300, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    tri = np.random.default_rng(1).integers(0, 300, (400, 3)).astype(np.int32)
    return SimpleNamespace(name=name, follows=follows, material="eye", triangles=tri, normals=directions,
                           vertices=(12.0 * directions + centre).astype(np.float32))  # fmt: skip


def head(contacts=("lips", "left_lids", "right_lids"), radius=12.0, more=(), flipped=False):
    parts = [part("face"), ball("eye_left", "left_eye", made_face.EYES[0]),
             ball("eye_right", "right_eye", made_face.EYES[1]), *more]  # fmt: skip
    data = SimpleNamespace(
        contacts=[contact(n, flipped) for n in contacts], eye_radius=radius, eyes=made_face.EYES, neck=NECK
    )
    posed = []
    made = SimpleNamespace(parts=parts, data=data, posed=posed, name="x", values=lambda v: v, pose=posed.append)
    made.part = lambda name: next(p for p in parts if p.name == name)
    return made


@pytest.mark.parametrize("flipped", [False, True])
def test_landmarks_lie_where_the_face_has_them(flipped: bool) -> None:
    own = head(flipped=flipped)
    found = find_landmarks(own, {c.name: c for c in own.data.contacts})
    assert set(found) == set(NAMES)
    wanted = {"nose_tip": (0, 0), "nose_bridge": (0, 39), "chin": (0, -71)}
    wanted |= {"mouth_left": (22, -38), "mouth_right": (-22, -38)}
    for side, sign in (("left", 1), ("right", -1)):
        places = {"inner": (20, 36), "outer": (46, 36), "upper": (33, 42), "lower": (33, 30)}
        wanted |= {f"{side}_eye_{k}": (sign * x, y) for k, (x, y) in places.items()}
    for name, (x, y) in wanted.items():
        np.testing.assert_allclose(found[name][:2], (x, y), atol=3.1 if name in ("nose_bridge", "chin") else 1.5)
        off = np.abs(found[name][2] - made_face.depth(*found[name][:2]))
        assert off < 1e-4, name
    profile = made_face.on_face(np.zeros(2001), np.linspace(-100, 100, 2001))[0]
    for name, low, high in (("upper_lip", -38, -26.5), ("lower_lip", -53.2, -38)):
        own_part = profile[(profile[:, 1] >= low) & (profile[:, 1] <= high)]
        best = own_part[own_part[:, 2].argmax()]
        assert found[name][2] == pytest.approx(best[2], abs=0.2) and abs(found[name][0]) < 2
        assert found[name][1] == pytest.approx(best[1], abs=1.01)


def test_what_can_be_seen_is_skin_and_the_fronts_of_the_eyes() -> None:
    more = [part("brow", shift=(0, 0, 3)), part("sockets"), part("teeth", "jaw", "teeth"), part("hair", "skin", "hair")]
    own = head(more=more)
    made = make_template(own, "x")
    assert own.posed == [{}] and made.neck is NECK
    skin = 2 * 141 * 201
    assert (made.eye < 0).sum() == skin and made.face.sum() == skin / 2
    for side in (0, 1):
        front = made.points[made.eye == side]
        assert (front[:, 2] > made_face.EYES[side, 2] + 0.3 * 12).all() and len(front) > 60
        np.testing.assert_allclose(np.linalg.norm(front - made_face.EYES[side], axis=1), 12.0, atol=1e-3)
    count = sum(int((p.vertices[:, 2] > 62 + 3.6).sum()) for p in own.parts[1:3])
    assert len(made.points) == skin + count == len(made.normals)
    assert made.radius == 12 and made.eyes is not made_face.EYES
    assert (
        made.height == pytest.approx(made.landmarks["nose_bridge"][1] - made.landmarks["chin"][1]) and made.height > 99
    )


def test_triangles_join_the_same_places_as_before() -> None:
    own = head(more=[part("brow", shift=(0, 0, 3))])
    made = make_template(own, "x")
    before = []
    for p in own.parts:
        kept = p.vertices[:, 2] > (65.6 if p.material == "eye" else -np.inf)
        before.append(p.vertices[p.triangles[kept[p.triangles].all(axis=1)]])
    np.testing.assert_allclose(made.points[made.triangles], np.concatenate(before), atol=1e-4)


@pytest.mark.parametrize("lacking", [{"radius": 0.0}, {"contacts": ("lips", "left_lids")}, {"contacts": ()}])
def test_a_head_without_eyes_or_openings_is_refused(lacking) -> None:
    with pytest.raises(FitError, match="--expressions-from old: the head has no eyes, or no openings"):
        make_template(head(**lacking), "old")
