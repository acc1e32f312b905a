"""Skin on a scan: normals, smoothing, detail, seats of lids, closed lips, and what follows the skin."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from small_head import JAW, sheet
from small_head import part as small_part

from surface.fit.transfer import skin as module
from surface.fit.transfer.register import Matcher, Matches
from surface.fit.transfer.scan import Samples
from surface.fit.transfer.skin import Ball, Skin, follow_skin, rims_of, seat_on_eyeballs
from surface.head import Contact, Head
from surface.head.model.data import Neck

OLD = Ball(np.array([[30.0, 0, 0], [-30.0, 0, 0]]), 12.0)
RIM = np.array([[1e3, 0.0, 0.0]])
DIRECTIONS = np.random.default_rng(0).normal(size=(200, 3)) * [0.5, 0.5, 0.2] + [0, 0, 1.0]
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)


FAR = module.Ball(np.array([[3e3, 0.0, 9e3], [-3e3, 0.0, 9e3]]), 12.0)
"""Eyeballs so far away that nothing is a lid."""


def grid(count: int = 17):
    """A curved sheet as part of a head: (u, v) even, triangles two to a square."""
    u, v = (a.ravel() for a in np.meshgrid(*2 * [np.linspace(0, 1, count)], indexing="ij"))
    at = np.arange(count * count).reshape(count, count)
    a, b, c, d = (k.ravel() for k in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    mesh = SimpleNamespace(uv=np.column_stack([u, v]), side=None,
                           triangles=np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))  # fmt: skip
    surface = sheet(0.0)
    return SimpleNamespace(name="face", surface=surface, mesh=mesh, vertices=surface.evaluate(mesh.uv))


def test_steps_go_to_each_point_from_the_mean_of_its_neighbours() -> None:
    tri, n = np.array([[0, 1, 2], [0, 2, 3], [2, 1, 4]]), 6
    near = {0: [1, 2, 3], 1: [0, 2, 4], 2: [0, 1, 3, 4], 3: [0, 2], 4: [1, 2], 5: []}
    step = np.eye(n)
    for k, others in near.items():
        step[k, others] -= 1.0 / max(len(others), 1)
    np.testing.assert_allclose(module._steps(tri, n).toarray(), step, atol=1e-12)


def test_a_border_that_is_pulled_takes_the_skin_beside_it_along_and_counts_more_in_the_fit(monkeypatch) -> None:
    made = Skin(grid(33), RIM, lambda p: p, FAR)
    before, border = made.at.copy(), np.flatnonzero(made.mesh.uv[:, 0] == 0.0)
    made.pull(border, before[border] + [0.0, 0.0, 1.0])
    moved = made.at - before
    np.testing.assert_allclose(moved[:, :2], 0.0, atol=1e-9)
    np.testing.assert_allclose(moved[border, 2], 1.0, atol=1e-3)
    rows = moved[:, 2].reshape(33, 33).mean(axis=1)
    assert (np.diff(rows[:8]) < 0.0).all() and rows[2] > 0.8 and abs(rows[-1]) < 0.1
    seen = []
    monkeypatch.setattr(module, "fit_points", lambda *given: seen.append(given[-1]) or SimpleNamespace(
        surface=None, points=None, at=None, part=None))  # fmt: skip
    made.solve(None, JAW)
    weight = seen[0].reshape(33, 33)
    np.testing.assert_allclose(weight[[0, -1]], [[20.0] * 33, [1.0] * 33], rtol=1e-6)
    assert (np.diff(weight, axis=0) <= 0.0).all()


def test_without_seams_nothing_is_pulled() -> None:
    made = Skin(grid(), RIM, lambda p: p, FAR)
    before = made.at.copy()
    made.pull(np.zeros(0, int), np.zeros((0, 3)))
    np.testing.assert_array_equal(made.at, before)


def test_normals_are_those_of_the_surface() -> None:
    part = grid(33)
    made = Skin(part, RIM, lambda p: p, FAR)
    du, dv = (
        part.surface.evaluate(np.clip(part.mesh.uv + e, 0, 1)) - part.surface.evaluate(np.clip(part.mesh.uv - e, 0, 1))
        for e in ([1e-3, 0], [0, 1e-3])
    )
    wanted = np.cross(du, dv)
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    assert (made.normals() * wanted).sum(axis=1).min() > 0.998
    made.at = np.zeros_like(made.at)
    assert np.isfinite(made.normals()).all()


class Lifted:
    """Stands for a matcher: the scan lies ``height`` along +z above where the skin was at first."""

    def __init__(self, rest, height, found) -> None:
        self.rest, self.height, self.found, self.heard = rest, height, found, []

    def find(self, at, normals, farthest, slide):
        self.heard.append((farthest, slide))
        return Matches(self.found, at + (self.rest + self.height - at) @ np.diag([0, 0, 1.0]))


def test_skin_goes_to_the_scan_and_fills_holes_smoothly() -> None:
    part = grid(21)
    part.vertices = np.column_stack([40 * part.mesh.uv, 0 * part.mesh.uv[:, 0]])
    made = Skin(part, np.zeros((0, 3)), lambda p: p, FAR)
    hole = np.linalg.norm(part.mesh.uv - 0.5, axis=1) < 0.2
    matcher = Lifted(made.rest, np.array([0, 0, 2.0]), ~hole)
    made.follow(matcher, 1.5)
    np.testing.assert_allclose(made.at[:, 2], 2.0, atol=0.05)
    np.testing.assert_allclose(made.at[:, :2], made.rest[:, :2], atol=0.1)
    assert matcher.heard == [(7.5, 0.0)] * 3


def test_skin_at_a_rim_is_carried_along_and_not_pulled_by_itself() -> None:
    part = grid(41)
    part.vertices = np.column_stack([40 * part.mesh.uv, 0 * part.mesh.uv[:, 0]])
    rim = np.column_stack([np.linspace(0, 40, 200), np.zeros(200), np.zeros(200)])
    made = Skin(part, rim, lambda p: p, FAR)
    y = part.vertices[:, 1]
    height = np.zeros((len(y), 3))
    height[y <= 1.01, 2] = 4.0  # what a scanner sees within an opening is not the skin's
    made.follow(Lifted(made.rest, height, np.ones(len(y), bool)), 1.0)
    assert np.abs(made.at[:, 2]).max() < 0.3
    free = Skin(part, np.zeros((0, 3)), lambda p: p, FAR)
    free.follow(Lifted(free.rest, height, np.ones(len(y), bool)), 1.0)
    assert free.at[:, 2].max() > 2.0


def test_the_surface_is_put_where_the_skin_lies() -> None:
    part = grid(21)
    made = Skin(part, RIM, lambda p: p, FAR)
    goal = part.surface.points * [1.1, 0.9, 1.0] + [0, 0, 5.0]
    made.at = part.surface.with_points(goal).evaluate(part.mesh.uv)
    assert len(made.solve(small_part("face", 0.0), JAW).points) == 25
    np.testing.assert_allclose(made.points, goal, atol=0.3)
    np.testing.assert_allclose(made.at, part.surface.with_points(made.points).evaluate(part.mesh.uv), atol=1e-9)


def test_control_points_follow_waves_that_their_net_is_fine_enough_for(root: Path) -> None:
    """Of 1 mm height and 48 mm length, all over the shipped head's face."""
    head = Head.load(root / "configs" / "heads" / "ict")
    made = Skin(head.part("face"), np.zeros((0, 3)), lambda p: p, Ball(head.data.eyes, head.data.eye_radius))
    x, y = 2 * np.pi / 48.0 * made.rest[:, :2].T
    made.at = made.rest + np.column_stack([0 * x, 0 * x, np.sin(x) * np.sin(y)])
    wanted = made.at.copy()
    assert len(made.solve(head.data.parts[0], head.data.jaw).points) == len(head.data.parts[0].points)
    assert np.sqrt(((made.at - wanted) ** 2).sum(axis=1).mean()) < 0.022


def test_a_part_with_copies_at_seams_counts_each_place_once() -> None:
    part = grid(5)
    part.vertices = np.vstack([part.vertices, part.vertices[:3]])
    assert len(Skin(part, RIM, lambda p: p, FAR).rest) == 25


@pytest.mark.parametrize("radius", [12.0, 15.0])
def test_lids_are_seated_as_high_above_the_new_eyeballs_as_above_the_old(radius: float) -> None:
    new = Ball(OLD.centres * 1.1 + [0, 3.0, -2.0], radius)
    for side in (0, 1):
        rest = OLD.centres[side] + (12.0 + 0.5) * DIRECTIONS
        moved = new.centres[side] + radius * (1.0 + 0.2 * np.abs(DIRECTIONS[:, :1])) * DIRECTIONS
        seated = seat_on_eyeballs(moved, rest, OLD, new)
        np.testing.assert_allclose(np.linalg.norm(seated - new.centres[side], axis=1), radius * 12.5 / 12, rtol=0.01)
        along = (seated - new.centres[side]) / np.linalg.norm(seated - new.centres[side], axis=1, keepdims=True)
        np.testing.assert_allclose(along, DIRECTIONS, atol=1e-9)
    far = np.array([[0.0, -80.0, 60.0]])
    np.testing.assert_array_equal(seat_on_eyeballs(far + 7.0, far, OLD, new), far + 7.0)


def two_lips(columns: int = 9, gap: float = 0.0):
    """Places of lips on the sheet, the upper above v = 0.5, in rows from the rim on, and its contact."""
    u = np.linspace(0.1, 0.9, columns)
    rows = np.linspace(0.0, 0.15, 6)
    sides = [np.stack(np.meshgrid(u, 0.5 + s * (gap + rows), indexing="ij"), axis=-1) for s in (1, -1)]
    return Contact("lips", "face", (), -1, 6.0, 0.4, np.stack(sides))


def test_of_two_lips_the_nearest_places_of_each_column_are_taken() -> None:
    rng = np.random.default_rng(3)
    at = rng.normal(size=(2, 5, 4, 3))
    lines, gap = module._lip_lines(at)
    for k in range(5):
        upper = min((at[0, k, m] for m in range(4)), key=lambda p: p[1])
        lower = max((at[1, k, m] for m in range(4)), key=lambda p: p[1])
        np.testing.assert_array_equal(lines[:, k], [upper, lower])
        assert gap[k] == upper[1] - lower[1]


def test_lips_that_a_scan_left_open_are_closed_and_their_share_is_kept() -> None:
    part, contact = grid(33), two_lips()
    made = Skin(part, RIM, lambda p: p, FAR)
    uv = part.surface.padded
    middle = uv[1][:, 1:4].mean(axis=1)
    made.points = (
        made.points
        + np.where(middle[:, None] > 0.5, [[0, 1.5, 0]], [[0, -1.0, 0]]) * (np.abs(middle - 0.5) < 0.4)[:, None]
    )
    before = made.points.copy()
    made.at = part.surface.with_points(made.points).evaluate(part.mesh.uv)
    share = part.surface.basis_matrix(contact.places[:, :, :4].reshape(-1, 2))

    def gap(points):
        return module._lip_lines((share @ points).reshape(2, 9, 4, 3))[1]

    rest, opened = gap(part.surface.points), gap(made.points)
    module.close_lips(made, contact, 1.0)
    assert (
        np.abs(gap(made.points) - rest).max() < 0.35 * np.abs(opened - rest).max()
        or (gap(made.points) <= rest + 1e-6).all()
    )
    assert np.array_equal(made.points[:, [0, 2]], before[:, [0, 2]])
    np.testing.assert_allclose(made.at, part.surface.with_points(made.points).evaluate(part.mesh.uv), atol=1e-9)


def test_lips_as_close_as_before_stay_where_they_are() -> None:
    part, contact = grid(17), two_lips(gap=0.05)
    made = Skin(part, RIM, lambda p: p, FAR)
    module.close_lips(made, contact, 1.0)
    np.testing.assert_allclose(made.points, part.surface.points, atol=1e-12)
    module.close_lips(made, contact, 0.5)
    assert np.abs(made.points - part.surface.points).max() > 0.1


def test_control_points_of_either_lip_move_by_its_share_and_those_far_away_not() -> None:
    part, contact = grid(9), two_lips()
    lines = part.surface.evaluate(contact.places[:, :, 0].reshape(-1, 2)).reshape(2, 9, 3)
    up = module._lip_share(part.surface, contact, lines)
    v = part.surface.padded[1][:, 1:4].mean(axis=1)
    near = np.abs(v - 0.5) < 0.05
    distance = np.min(
        [np.linalg.norm(part.surface.points[:, None] - line[None], axis=2).min(axis=1) for line in lines], axis=0
    )
    assert (np.abs(up[distance > 16.5]) < 1e-12).all() and (distance > 16.5).any() and near.any()
    assert (up[v > 0.51] <= 0).all() and (up[v < 0.49] >= 0).all() and up.min() < -0.3 < 0.04 < up.max()
    assert up.min() >= -0.4 and up.max() <= 0.6


def test_another_part_follows_the_skin_near_it_and_the_map_far_from_it() -> None:
    part = grid(21)
    skin = Skin(part, RIM, lambda p: p + np.array([1.0, 0, 0]), FAR)
    skin.at = skin.at + np.array([0.0, 0.0, 2.0])
    on, far = skin.rest[[5, 200]] + [0, 0, 0.01], skin.rest[[5, 200]] + [0, 0, 40.0]
    half = skin.rest[[210]] + [0, 0, 6.0]
    np.testing.assert_allclose(
        follow_skin(on, skin, lambda p: p + np.array([1.0, 0, 0])), on + np.array([1, 0, 2]), atol=0.01
    )
    np.testing.assert_allclose(
        follow_skin(far, skin, lambda p: p + np.array([1.0, 0, 0])), far + np.array([1, 0, 0]), atol=1e-9
    )
    push = (follow_skin(half, skin, lambda p: p + np.array([1.0, 0, 0])) - half)[0]
    assert 0.5 < push[2] < 1.5 and push[0] == pytest.approx(1.0)


def test_means_of_moves_weigh_what_is_near_more() -> None:
    rest = np.array([[0.0, 0, 0], [1.0, 0, 0], [0, 2.0, 0], [0, 0, 3.0], [4.0, 0, 0], [0, 5.0, 0], [90.0, 0, 0]])
    moves = np.eye(7, 3)
    w = np.array([1.0 / (np.linalg.norm(p) + 0.3) ** 2 for p in rest[:6]])
    np.testing.assert_allclose(module._followed(np.zeros((1, 3)), rest, moves), [w @ moves[:6] / w.sum()])
    np.testing.assert_allclose(module._followed(rest[6:], rest, 0 * moves + 3.0), [[3, 3, 3]])


def test_rims_are_the_loops_inside_the_face() -> None:
    part = grid(5)
    loops = [
        np.array([[0.0, 0], [1, 0], [1, 1]]),
        np.array([[0.4, 0.4], [0.6, 0.4], [0.5, 0.6]]),
        np.array([[0.1, 0.1], [0.2, 0.1], [0.1, 0.2]]),
    ]
    contacts = [SimpleNamespace(name="left_lids", part="x"), SimpleNamespace(name="lips", part="face")]
    parts = [SimpleNamespace(name="x", loops=[]), SimpleNamespace(name="face", loops=loops)]
    data = SimpleNamespace(contacts=contacts, parts=parts)
    found = rims_of(SimpleNamespace(data=data, part=lambda name: {"face": part}[name]))
    np.testing.assert_allclose(found, part.surface.evaluate(np.vstack(loops[1:])))


def test_detail_of_a_scan_is_followed_along_normals() -> None:
    part = grid(31)
    part.vertices = np.column_stack([40 * part.mesh.uv, 0 * part.mesh.uv[:, 0]])
    made = Skin(part, np.zeros((0, 3)), lambda p: p, FAR)
    at = np.random.default_rng(0).uniform(0, 40, (4000, 2))
    samples = Samples(
        np.column_stack([at, 0.8 + 0.02 * at[:, 0]]), np.tile([0, 0, 1.0], (4000, 1)), np.zeros(4000, bool)
    )
    made.follow(Matcher(samples), 1.0)
    np.testing.assert_allclose(made.at[:, 2], 0.8 + 0.02 * made.at[:, 0], atol=0.08)


@pytest.mark.parametrize("mended", [True, False])
def test_skin_that_detail_would_fold_stays_where_the_map_has_it(mended, monkeypatch) -> None:
    if not mended:
        monkeypatch.setattr(module, "FOLDED", -2.0)  # nothing counts as a fold: this detail does turn skin over
    part = grid(41)
    part.vertices = np.column_stack([40 * part.mesh.uv, 0 * part.mesh.uv[:, 0]])
    made = Skin(part, np.zeros((0, 3)), lambda p: p, FAR)
    flat, height = made._facing(made.rest), np.zeros((41 * 41, 3))
    rough = part.vertices[:, 0] < 15  # as curls over an ear
    height[:, 2] = np.where(rough, np.random.default_rng(0).uniform(-12, 12, len(rough)), 2.0)
    made.follow(Lifted(made.rest, height, np.ones(len(rough), bool)), 1.0)
    assert ((made._facing(made.at) * flat).sum(axis=1).min() > 0.0) == mended
    np.testing.assert_allclose(made.at[part.vertices[:, 0] > 22, 2], 2.0, atol=0.2)


NO_NECK = Neck((0.0, -900.0, 0.0), 0.0, -990.0, -950.0)


def roof(lost_mm: float) -> tuple[Skin, np.ndarray]:
    """Skin that follows a scan up a slope and, from its ridge on, lies level without a scan; and how far beyond it."""
    part = grid(61)
    part.vertices = np.column_stack([240 * part.mesh.uv, 0 * part.mesh.uv[:, 0]])
    made = Skin(part, np.zeros((0, 3)), lambda p: p, FAR)
    beyond = made.rest[:, 0] - 140.0
    made.at = made.rest + np.column_stack([0 * beyond, 0 * beyond, 0.8 * np.minimum(beyond, 0.0)])
    made._on = (beyond < 0.0) | (beyond > lost_mm)
    return made, beyond


def bend(made: Skin) -> float:
    """The greatest second difference of heights along the middle of a roof."""
    return float(np.abs(np.diff(made.at[:, 2].reshape(61, 61)[:, 30], 2)).max())


def front_at(x: float) -> Samples:
    """One sample of the front of a face, at the middle of a roof's height."""
    return Samples(np.array([[x, 120.0, 0.0]]), np.array([[0.0, 0.0, 1.0]]), np.zeros(1, bool))


def test_skin_is_round_where_it_leaves_the_scan_for_good() -> None:
    made, beyond = roof(999.0)
    before, corner = made.at.copy(), bend(made)
    made.round_off(front_at(-900.0), NO_NECK, 1.0)
    assert bend(made) < 0.35 * corner
    np.testing.assert_allclose(made.at[beyond < -80.0], before[beyond < -80.0], atol=0.01)


@pytest.mark.parametrize(("lost_mm", "front", "neck"), [
    (20.0, front_at(-900.0), NO_NECK),  # a hole, however sharp
    (999.0, Samples(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, bool)), Neck((0.0, 0.0, 0.0), 0.0, 900.0, 950.0)),
])  # fmt: skip
def test_holes_and_necks_do_not_become_round(lost_mm, front, neck) -> None:
    made, _ = roof(lost_mm)
    before = made.at.copy()
    made.round_off(front, neck, 1.0)
    np.testing.assert_array_equal(made.at, before)


def test_the_front_of_a_face_stays_on_the_scan() -> None:
    made, _ = roof(999.0)
    before = made.at.copy()
    near = np.linalg.norm(made.rest - [120.0, 120.0, 0.0], axis=1) < 12.0
    made.round_off(front_at(120.0), NO_NECK, 1.0)
    moved = np.linalg.norm(made.at - before, axis=1)
    assert moved.max() > 1.0 and moved[near].max() < 0.2
