"""Poses become control points."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from small_head import JAW, all_points, part, small_head

from surface.head.model.data import Contact, Neck, Seam
from surface.head.model.meshes import make_surface
from surface.head.model.parameters import NAMES, read_pose
from surface.head.model.sway import breath_moves
from surface.head.posing import rig as rig_module
from surface.head.posing.rig import LID_MM, SkinRig, jaw_path, rigid_motion

HEAD = small_head()


def pose(**given: float):
    return read_pose(np.array([given.get(n, 0.0) for n in NAMES]))


def moved(p, **given: float) -> np.ndarray:
    return SkinRig(p, HEAD).apply(pose(**given)) - p.points


def test_groups_add_up():
    p = part("a", 0, groups=[all_points("mouthPucker", (0, 0, 6)), all_points("cheekPuff", (2, 0, 0))])
    np.testing.assert_allclose(moved(p, mouthPucker=0.5, cheekPuff=1), np.tile([2.0, 0, 3], (25, 1)), atol=1e-6)
    assert not moved(p).any()


def test_unknown_groups_are_left_out():
    assert not moved(part("a", 0, groups=[all_points("earWiggle", (9, 9, 9))]), mouthPucker=1).any()


@pytest.mark.parametrize("amount", [0.3, 1.0])
def test_the_jaw_swings_on_its_arc(amount):
    p = part("a", 0, jaw=np.ones(25))
    turn, shift = jaw_path(JAW, amount)
    np.testing.assert_allclose(moved(p, jawOpen=amount), p.points @ turn.T + shift - p.points, atol=1e-9)


def test_the_hinge_turns_and_glides():
    turn, shift = jaw_path(JAW, 1.0)
    np.testing.assert_allclose(turn @ JAW.centre + shift, np.add(JAW.centre, JAW.glide))
    assert (turn @ [0, 0, 100.0])[1] < -35  # what is in front of the hinge goes down


def test_closed_lips_stay_together_at_every_opening():
    turn, shift = jaw_path(JAW, 1.0)
    bare = part("a", 0, jaw=np.ones(25))
    far = bare.points + np.array([0, -20.0, 100.0])
    close = -(far @ turn.T + shift - far)
    p = replace(bare, points=far, groups=[replace(all_points("mouthClose", (0, 0, 0)), moves=close.astype(np.float32))])
    for amount in (0.2, 0.5, 0.8, 1.0):
        assert np.abs(moved(p, jawOpen=amount, mouthClose=amount)).max() < 1e-4


def lid(hold: float):
    angle = np.linspace(0.1, 1.2, 25)
    eye = HEAD.eyes[0]
    at = eye + 12.5 * np.column_stack([np.zeros(25), np.sin(angle), np.cos(angle)])
    down = 12.5 * np.column_stack([np.zeros(25), np.sin(angle - 1.2), np.cos(angle - 1.2)]) + eye - at
    group = replace(all_points("eyeBlinkLeft", (0, 0, 0)), moves=down.astype(np.float32))
    return replace(part("a", 0, lids=np.full(25, hold)), points=at, groups=[group])


def test_lids_keep_to_the_eyeball_half_way():
    for amount in (0.25, 0.5, 0.75, 1.0):
        straight = np.linalg.norm(lid(0.0).points + moved(lid(0.0), eyeBlinkLeft=amount) - HEAD.eyes[0], axis=1)
        held = np.linalg.norm(lid(1.0).points + moved(lid(1.0), eyeBlinkLeft=amount) - HEAD.eyes[0], axis=1)
        assert amount == 1.0 or straight.min() < 12.0
        assert np.abs(held - 12.5).max() < 1e-4


def test_no_lid_sinks_into_the_eyeball():
    p = lid(1.0)
    inward = replace(p, groups=[replace(p.groups[0], moves=(-0.4 * (p.points - HEAD.eyes[0])).astype(np.float32))])
    distance = np.linalg.norm(p.points + moved(inward, eyeBlinkLeft=1) - HEAD.eyes[0], axis=1)
    assert distance.min() > min(12.5, 12.0 + LID_MM) - 1e-4


def test_rigid_parts_follow_jaw_and_eyes():
    p = pose(jawOpen=0.5, jawForward=1.0, leftEyeYaw=1.0, headPitch=0.5)
    point = np.array([5.0, -10.0, 80.0])

    def at(follows: str, x: np.ndarray) -> np.ndarray:
        linear, shift = rigid_motion(follows, HEAD, p)
        return linear @ x + shift

    np.testing.assert_array_equal(at("skull", point), point)
    jaw_turn, jaw_shift = jaw_path(JAW, 0.5)
    np.testing.assert_allclose(at("jaw", point), jaw_turn @ point + jaw_shift + [0, 0, 8.0])
    np.testing.assert_allclose(at("left_eye", HEAD.eyes[0]), HEAD.eyes[0])
    ahead = at("left_eye", HEAD.eyes[0] + [0, 0, 1.0]) - HEAD.eyes[0]
    assert ahead[0] > 0.5  # yaw + looks to the subject's left


def test_apply_reuses_its_buffer():
    rig = SkinRig(part("a", 0, groups=[all_points("mouthPucker", (0, 0, 6))]), HEAD)
    assert rig.apply(pose(mouthPucker=1)) is rig.apply(pose())


def test_a_rig_rests_while_nothing_changes_and_wakes_when_it_is_told_to():
    rig = SkinRig(part("a", 0, groups=[all_points("mouthPucker", (0, 0, 6))]), small_head())

    def pose(**given: float):
        return read_pose(np.array([given.get(n, 0.0) for n in NAMES]))

    rig.apply(pose(mouthPucker=0.5))
    version, points = rig.version, rig.points.copy()
    rig.apply(pose(mouthPucker=0.5, browInnerUp=1.0))  # none of this part's business
    assert rig.version == version
    rig.rest[0] += 1.0
    rig.invalidate()
    np.testing.assert_allclose(rig.apply(pose(mouthPucker=0.5))[0] - points[0], 1.0)
    assert rig.version == version + 1


def lined(**other):
    """Part "b" lies behind the lids of "a": the eye, 12 mm large, is under its middle."""
    border = np.linspace(0, 1, 6)
    seam = Seam("a", "b", np.column_stack([np.ones(6), border]), np.column_stack([np.zeros(6), border]))
    places = np.stack(np.meshgrid(np.linspace(0.2, 0.8, 5), np.linspace(0.5, 0.7, 4), indexing="ij"), axis=-1)
    lids = Contact("lids", "a", ("b",), 0, 60.0, 0.5, np.stack([places, places[:, :, ::-1] * [1, -1] + [0, 0.95]]))
    fields = {"eyes": np.array([[20.0, 0, 22.5], [-30, 0, 12]]), "contacts": [lids], "seams": [seam], **other}
    return small_head(parts=[part("a", -40), part("b", 0.5)], **fields)


def test_what_is_sewn_behind_lids_is_kept_out_of_their_eyeball():
    head = lined()
    ((eye, clearance),) = rig_module._clearances(head.parts[1], head)
    assert eye == 0 and clearance.radius == 12.0
    surface = make_surface(head.parts[1])
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 72), np.linspace(0, 1, 36)), axis=-1).reshape(-1, 2)
    local = surface.evaluate(grid) - head.eyes[0]
    near = grid[(np.linalg.norm(local, axis=1) < 1.4 * 12.0) & (local[:, 2] > 0.0)]
    assert 50 < len(near) < len(grid) / 2 and len(clearance.samples) == len(near)
    np.testing.assert_allclose(clearance.samples[:, 0], surface.evaluate(near)[:, 0] - head.eyes[0][0], atol=0.3)


def test_only_what_is_sewn_to_lids_near_an_eye_is_kept_out_of_it():
    (lids,), (seam,) = lined().contacts, lined().seams
    for changes in (
        {"contacts": []},
        {"contacts": [replace(lids, followers=())]},
        {"contacts": [replace(lids, eye=-1)]},
        {"seams": []},
        {"seams": [replace(seam, part_a="b", part_b="a")]},
        {"seams": [replace(seam, part_a="other")]},
        {"eyes": np.array([[20.0, 0, -90.0], [0, 0, 0]])},
    ):
        head = lined(**changes)
        assert rig_module._clearances(head.parts[1], head) == [], changes
    head = lined()
    assert rig_module._clearances(head.parts[0], head) == []  # the lids themselves


def test_each_part_solves_its_own_contacts_and_follows_those_of_others():
    head = lined()
    face, lining = (SkinRig(p, head) for p in head.parts)
    now = pose()
    face.apply(now)
    assert list(now.pushes) == ["lids"]
    lining.apply(now)
    assert list(now.pushes) == ["lids"]
    rested = lining.points.copy()
    now.pushes["lids"] = np.full_like(now.pushes["lids"], 0.5)
    moved_points = lining.apply(now)
    assert np.abs(moved_points - rested).max() > 0.1  # it goes along with what it follows
    bare = SkinRig(head.parts[1], lined(contacts=[]))
    np.testing.assert_array_equal(bare.apply(pose()), head.parts[1].points)


def test_lips_take_back_the_jaw_by_how_far_mouth_close_moves_them():
    moves = np.zeros((25, 3), np.float32)
    moves[:4] = [[0, 5, 0], [0, 20, 0], [0, 60, 0], [3, 0, -4]]
    closing = replace(all_points("mouthClose", (0, 0, 0)), moves=moves)
    p = part("a", 0, groups=[closing, all_points("mouthPucker", (0, 0, 90))])
    share = rig_module._undo_share(p)
    np.testing.assert_allclose(share[:5], [0.25, 1.0, 1.0, 0.25, 0.0])


def test_what_rigid_parts_depend_on_is_named():
    head = small_head()
    p = pose(jawOpen=0.5, jawForward=0.25, leftEyeYaw=1.0, rightEyePitch=0.5)
    assert rig_module.motion_key("jaw", head, p) == (0.5, 0.25)
    assert rig_module.motion_key("left_eye", head, p) == tuple(p.gaze[0].tolist())
    assert rig_module.motion_key("right_eye", head, p) == tuple(p.gaze[1].tolist())
    assert rig_module.motion_key("skull", head, p) == ()
    linear, shift = rigid_motion("right_eye", head, p)
    np.testing.assert_allclose(linear @ head.eyes[1] + shift, head.eyes[1])
    np.testing.assert_allclose(linear[:, 2], rig_module.optical_axis(p.gaze[1]))


@pytest.mark.parametrize(
    ("lips", "name", "group", "material", "wanted"),
    [
        (True, "tongue", "tongueOut", "tongue", True), (True, "tongue", "jawOpen", "tongue", False),
        (False, "tongue", "tongueOut", "tongue", False), (True, "", "tongueOut", "tongue", False),
        (False, "tongue", "jawOpen", "tongue", False), (True, "teeth", "tongueOut", "teeth", False),
        (True, "lining", "tongueOut", "mouth", False),
    ],
)  # fmt: skip
def test_a_tongue_rests_on_lips_of_another_part(monkeypatch, lips, name, group, material, wanted):
    """Teeth, and what lines the mouth, move as a tongue comes out, too, for the jaw opens."""
    asked: list[str] = []
    monkeypatch.setattr(rig_module, "tongue_rest", lambda part, head: asked.append(part.name))
    p = replace(part(name, 0, groups=[all_points(group, (0, 0, 6))]), material=material)
    for other, eye, counts in (("face", -1, True), ("face", 0, False), (name, -1, False)):
        asked.clear()
        contact = SimpleNamespace(eye=eye, part=other, followers=(), seal=None)
        head = replace(HEAD, contacts=[contact] if lips else [])
        if other == name:
            monkeypatch.setattr(rig_module, "ContactSolver", lambda *_: None)
            monkeypatch.setattr(rig_module, "SealDriver", lambda _: None)
            head = replace(head, parts=[p])
        monkeypatch.setattr(rig_module, "_clearances", lambda *_: [])
        SkinRig(p, head)
        assert asked == ([name] if wanted and counts else [])


CHEST = Neck((0.0, 30.0, 0.0), 0.0, 0.0, 15.0)  # a patch of which the lower half is a chest


def test_a_breath_moves_the_chest_and_nothing_above_it():
    p = part("a", 0)
    rig = SkinRig(p, small_head(neck=CHEST))
    breath = replace(pose(), rise_mm=2.0)
    by = rig.apply(breath) - p.points
    np.testing.assert_allclose(by, 2.0 * breath_moves(p.points, CHEST))
    low = p.points[:, 1] <= 0.0
    assert (by[low, 1] > 0.9).all() and not by[p.points[:, 1] >= 15.0].any()
    assert np.array_equal(rig.apply(pose()), p.points)


def test_only_what_breathes_is_computed_again_and_only_if_it_does():
    chest, face = SkinRig(part("a", 0), small_head(neck=CHEST)), SkinRig(part("a", 0), HEAD)
    for rise_mm, versions in ((0.0, (1, 1)), (1.0, (2, 1)), (1.0, (2, 1)), (0.5, (3, 1))):
        for rig in (chest, face):
            rig.apply(replace(pose(mouthPucker=0.0), rise_mm=rise_mm))
        assert (chest.version, face.version) == versions
