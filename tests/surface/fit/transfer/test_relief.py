"""Relief maps of faces and their correlation: known shifts are found again, whatever the light or the depth."""

from dataclasses import replace

import made_face
import numpy as np
import pytest

from surface.fit.transfer import relief as module
from surface.fit.transfer.relief import FEATURES, PIXEL_MM, SINGLE, Finder, correlate, make_relief, mirrored
from surface.fit.transfer.template import NAMES

LOW, HIGH = np.array([-60.0, -90.0]), np.array([60.0, 60.0])
DENSE = np.column_stack([a.ravel() for a in np.meshgrid(np.arange(-70, 70, 0.7), np.arange(-100, 100, 0.7))])


@pytest.fixture(scope="module")
def face():
    return made_face.template(2.0)


@pytest.fixture(scope="module")
def finder(face):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "COUNT", 50_000)
        return Finder(face, made_face.samples(50_000))


def at(shift=(0.0, 0.0)) -> np.ndarray:
    return made_face.on_face(*DENSE.T)[0] + [*shift, 0.0]


@pytest.fixture(scope="module")
def still():
    return make_relief(at(), LOW, HIGH)


def test_relief_is_what_stands_out_by_millimetres_and_neither_depth_nor_slope(still) -> None:
    assert still.relief.shape == (1 + np.ceil(150 / PIXEL_MM), 1 + np.ceil(120 / PIXEL_MM))
    inner = (slice(30, -30), slice(30, -30))
    sloped = at()
    sloped[:, 2] += 100.0 + 0.3 * sloped[:, 0]
    other = make_relief(sloped, LOW, HIGH)
    assert np.abs(other.relief - still.relief)[inner].max() < 0.3
    tip, cheek, lips = (still.relief[still.pixel(np.array(p))] for p in ((0, 0), (40, -15), (0, -38)))
    assert tip > 5 and abs(cheek) < 1 and lips < -1
    assert still.known[inner].min() == 1.0


def test_relief_is_depth_less_its_mean_over_a_round_window() -> None:
    wave = DENSE[:, 0] * 2 * np.pi / 24.0
    found = make_relief(np.column_stack([DENSE, np.cos(wave)]), LOW, HIGH)
    k = 2 * np.pi / 24.0
    factor = np.exp(-0.5 * (k * 1.0) ** 2) - np.exp(-0.5 * (k * 6.0) ** 2)  # of two Gaussians, by Fourier
    x = LOW[0] + PIXEL_MM * np.arange(found.relief.shape[1])
    row = found.relief[90, 40:-40]
    np.testing.assert_allclose(row, factor * np.cos(k * x[40:-40]), atol=0.06)


def test_the_foremost_point_of_a_pixel_counts_and_what_has_no_points_is_not_known() -> None:
    points = at()
    behind = np.vstack([points - [0, 0, 30], points, points - [0, 0, 20]])
    np.testing.assert_allclose(make_relief(behind, LOW, HIGH).relief, make_relief(points, LOW, HIGH).relief)
    gap = points[np.hypot(points[:, 0] - 20, points[:, 1] + 10) > 8]
    found = make_relief(gap, LOW, HIGH)
    assert (
        found.known[found.pixel(np.array([20.0, -10]))] == 0 and found.relief[found.pixel(np.array([20.0, -10]))] == 0
    )
    assert found.known[found.pixel(np.array([20.0, 5]))] == 1
    nothing = make_relief(np.zeros((0, 3)), LOW, HIGH)
    assert not nothing.known.any() and not nothing.relief.any()


@pytest.mark.parametrize("shift", [(4.0, -2.4), (-5.6, 3.2), (0.0, 0.0)])
def test_a_correlation_is_greatest_at_the_shift_by_which_a_piece_was_moved(still, shift) -> None:
    score = correlate(still, make_relief(at(shift), LOW, HIGH), np.array([0.0, 0, 0]), (20.0, 14.0), 8.0)
    assert score.shape == (21, 21) and -1 <= score.min() < 0.5
    row, column = np.unravel_index(score.argmax(), score.shape)
    np.testing.assert_allclose([(column - 10) * PIXEL_MM, (row - 10) * PIXEL_MM], shift, atol=1e-9)
    assert score.max() > 0.97


def test_a_correlation_is_pearsons_of_the_known_pixels(still) -> None:
    other = make_relief(at((1.6, 0.0))[::2], LOW, HIGH)
    hole = other.known.copy()
    row, column = still.pixel(np.array([22.0, -38.0]))
    hole[row - 3 : row + 2, column : column + 4] = 0
    other = replace(other, known=hole, relief=other.relief * hole)
    score = correlate(still, other, np.array([22.0, -38.0, 0]), (8.0, 6.4), 2.4)
    for i, j in ((0, 0), (3, 3), (5, 1), (6, 6)):
        a = still.relief[row - 8 : row + 9, column - 10 : column + 11]
        r, c = row + i - 3, column + j - 3
        b, known = (m[r - 8 : r + 9, c - 10 : c + 11] for m in (other.relief, hole))
        wanted = np.corrcoef(a[known > 0], b[known > 0])[0, 1]
        assert score[i, j] == pytest.approx(wanted, abs=1e-9)


def test_where_too_little_is_known_there_is_no_correlation(still) -> None:
    for share, known in ((0.4, False), (0.7, True)):
        part = still.known.copy()
        row, _ = still.pixel(np.zeros(3))
        part[row - 8 + round(17 * share) :] = 0
        score = correlate(still, replace(still, known=part, relief=still.relief * part), np.zeros(3), (8.0, 6.4), 0.8)
        assert (score[1, 1] > -1) == known
    assert (correlate(still, still, np.array([500.0, 500, 0]), (8.0, 8.0), 0.8) >= -1).all()  # beyond the map


def test_of_shifts_that_score_alike_the_smaller_is_taken() -> None:
    score = np.full((41, 41), -0.5)
    score[20, 20 + 15], score[20 - 5, 20] = 0.80, 0.75  # 12 mm to the side, 4 mm down
    shift, sure = module._shift(score)
    np.testing.assert_allclose(shift, [0.0, -4.0])
    assert sure == 0.75
    score[20, 20 + 15] = 0.95
    assert module._shift(score)[1] == 0.95
    shift, sure = module._shift(np.where(score.T == 0.95, 0.80, score.T))
    np.testing.assert_allclose(shift, [-4.0, 0.0])  # the same along either axis
    assert sure == 0.75


@pytest.mark.parametrize("how", ["find", "refine"])
def test_landmarks_are_found_where_the_scan_has_them(face, finder, how) -> None:
    moved = {n: p + np.array([2.4, -1.6, 4.0]) for n, p in face.landmarks.items()}
    found = getattr(finder, how)(face.points + np.array([2.4, -1.6, 4.0]), moved, 5.0)
    names = SINGLE if how == "refine" else [n for every, _ in FEATURES for n in every]
    assert set(found) <= set(names) and {"mouth_left", "mouth_right", "left_eye_inner", "right_eye_outer"} <= set(found)
    for name, (place, sure) in found.items():
        off = np.abs(place - face.landmarks[name])
        assert sure > 0.6 and off[2] < 3.0, name
        # a scan that is not symmetric about the shift moves both eyes by the mean of their shifts to the middle
        assert off[1] < 2.0 and (off[0] < 2.0 or "eye" in name or how == "refine"), name


def test_eyes_that_stand_further_apart_are_found_on_both_sides(face, finder) -> None:
    side = {n: np.array([2.4 * np.sign(p[0]), 1.6, 0.0]) for n, p in face.landmarks.items()}
    at = face.points - np.column_stack([2.4 * np.sign(face.points[:, 0]), 0 * face.points[:, 1] + 1.6, 0 * face.eye])
    found = finder.find(at, {n: p - side[n] for n, p in face.landmarks.items()}, 6.0)
    for name in ("left_eye_inner", "left_eye_outer", "right_eye_inner", "right_eye_outer"):
        np.testing.assert_allclose(found[name][0][:2], face.landmarks[name][:2], atol=1.0)


def test_what_lies_behind_the_visible_skin_stays_as_far_behind_it(face, finder) -> None:
    marks = {n: p - np.array([0, 0, 3.0]) * (n == "mouth_left") for n, p in face.landmarks.items()}
    found = finder.find(face.points, marks, 4.0)
    deep = [face.landmarks[n][2] - found[n][0][2] for n in ("mouth_left", "mouth_right")]
    assert deep[0] - deep[1] == pytest.approx(3.0, abs=0.6)


def test_a_scan_of_nothing_like_it_has_no_landmarks(face, monkeypatch) -> None:
    monkeypatch.setattr(module, "COUNT", 20_000)
    flat = made_face.samples(20_000)
    noise = np.random.default_rng(0).normal(size=20_000)
    points = np.column_stack([flat.points[:, :2], 80 + noise])
    found = Finder(face, replace(flat, points=points)).find(face.points, face.landmarks, 8.0)
    assert not found


def test_names_are_mirrored() -> None:
    assert mirrored("left_eye_inner") == "right_eye_inner" and mirrored("mouth_right") == "mouth_left"
    assert {mirrored(n) for n in NAMES} == set(NAMES) and mirrored("chin") == "chin"


def test_a_piece_of_an_image_is_zero_outside_and_a_place_beyond_it_is_at_its_edge() -> None:
    image = np.arange(1.0, 31.0).reshape(5, 6)
    for row, column in ((2, 3), (0, 0), (4, 5), (-3, 2), (9, 9), (2, -1)):
        r, c = min(max(row, 0), 4), min(max(column, 0), 5)
        wanted = [
            [image[i, j] if 0 <= i < 5 and 0 <= j < 6 else 0.0 for j in range(c - 3, c + 4)]
            for i in range(r - 2, r + 3)
        ]
        np.testing.assert_array_equal(module._cut(image, row, column, 2, 3), wanted)


@pytest.mark.parametrize("sunk", [0.0, 4.0])
def test_eyes_are_found_where_they_lie_behind_their_lids_too(face, monkeypatch, sunk) -> None:
    monkeypatch.setattr(module, "COUNT", 50_000)
    balled = replace(face, points=face.points + np.outer(face.eye >= 0, [0, 0, 3.0]))  # eyes of people stand out
    samples = made_face.samples(60_000)
    x, y = np.abs(samples.points[:, 0]), samples.points[:, 1]
    inside = ((x - 33) / 11) ** 2 + ((y - 36) / 5) ** 2 < 1.0
    carved = replace(samples, points=samples.points + np.outer(inside, [0, 0, 3.0 - sunk]) + [0, 4.0, 0])
    finder = Finder(balled, carved)
    found = finder.find(balled.points, balled.landmarks, 8.0)
    for name in ("left_eye_inner", "right_eye_outer"):
        np.testing.assert_allclose(found[name][0][:2], balled.landmarks[name][:2] + np.array([0, 4.0]), atol=0.9)
    alone = {n for n in finder.refine(balled.points, balled.landmarks, 3.0) if "_eye_" in n}
    assert bool(alone) == (sunk == 0.0)
