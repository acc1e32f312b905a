"""Blinks that leave a gap are lengthened along the eyeball until lids meet, and nothing else is changed."""

from dataclasses import replace

import numpy as np
import pytest
from eye_face import CENTRES, RADIUS, face

from surface.fit.eyes import blink as module
from surface.fit.eyes.blink import shut_blinks
from surface.fit.eyes.openings import find_openings


@pytest.fixture(scope="module")
def plain():
    return face()


@pytest.fixture(scope="module")
def openings(plain):
    return find_openings(plain, np.ones(len(plain.faces), bool), 0.0, None)


def shortened(mesh, share: float):
    return replace(mesh, deltas=mesh.deltas * np.array([share, share, 1.0])[:, None, None])


def gap(mesh, openings, index: int) -> float:
    """Greatest angle between both lids of an eye in its blink, in mm along the eyeball."""
    rest = mesh.vertices - CENTRES[index]
    return float(module.lid_edges(rest + mesh.deltas[index], openings[index].edge, rest).gap.max()) * RADIUS


def shut(mesh, openings):
    return shut_blinks(mesh, openings, CENTRES, RADIUS)


@pytest.mark.parametrize("share", [0.55, 0.7, 0.85])
def test_a_blink_that_leaves_a_gap_is_lengthened_until_lids_overlap(plain, openings, share: float) -> None:
    short = shortened(plain, share)
    made, notes = shut(short, openings)
    for k in (0, 1):
        assert gap(short, openings, k) > 0.5 and -2.5 < gap(made, openings, k) < 0.0
    assert [n.split()[0] for n in notes] == ["eyeBlinkLeft", "eyeBlinkRight"]
    assert f"{gap(short, openings, 0):.1f} mm open" in notes[0]


def test_lids_turn_about_the_eye_and_keep_their_height_above_it(plain, openings) -> None:
    short = shortened(plain, 0.7)
    made, _ = shut(short, openings)
    more = made.deltas[0] - short.deltas[0]
    changed = np.abs(more).max(axis=1) > 1e-9
    before, after = (plain.vertices + d - CENTRES[0] for d in (short.deltas[0], made.deltas[0]))
    np.testing.assert_allclose(more[:, 0], 0.0)
    radii = [np.hypot(p[changed, 1], p[changed, 2]) for p in (before, after)]
    np.testing.assert_allclose(radii[1], radii[0], atol=1e-9)
    assert changed.any() and not changed[plain.vertices[:, 0] < 5].any()  # the other eye stays
    beside = np.abs(plain.vertices[:, 0] - 32.0) > 1.4 * 13.0  # beyond the corners
    assert not changed[beside].any()
    far = np.linalg.norm(plain.vertices - CENTRES[0], axis=1) > 2 * RADIUS
    assert not changed[far].any()
    turned = np.arctan2(after[:, 1], after[:, 2]) - np.arctan2(before[:, 1], before[:, 2])
    edge = openings[0].edge
    upper = plain.vertices[edge, 1] > 40.5
    assert turned[edge][upper].min() < -0.02 and turned[edge][~upper].max() > 0.003
    assert -turned[edge].min() > 4 * turned[edge].max()  # the upper lid goes most of the way
    np.testing.assert_array_equal(made.deltas[2], short.deltas[2])
    np.testing.assert_array_equal(short.deltas, shortened(plain, 0.7).deltas)  # what was given is not changed


@pytest.mark.parametrize("share", [0.05, 0.3])
def test_a_shape_that_hardly_shuts_the_eye_is_no_blink(plain, openings, share: float) -> None:
    short = shortened(plain, share)
    made, notes = shut(short, openings)
    np.testing.assert_array_equal(made.deltas, short.deltas)
    assert notes == []


def test_lids_that_overlap_enough_stay_and_those_that_just_meet_change_without_a_note(plain, openings) -> None:
    past = shortened(plain, 1.45)
    middle = np.abs(np.abs(plain.vertices[:, 0]) - 32.0) < 5
    np.testing.assert_array_equal(shut(past, openings)[0].deltas[:, middle], past.deltas[:, middle])
    just = shortened(plain, 1.15)
    assert -1.0 < gap(just, openings, 0) < 0.5
    made, notes = shut(just, openings)
    assert notes == [] and gap(made, openings, 0) < gap(just, openings, 0)


def test_without_a_blink_of_a_side_that_side_stays(plain, openings) -> None:
    short = replace(shortened(plain, 0.7), names=("x", "eyeBlinkRight", "jawOpen"))
    made, notes = shut(short, openings)
    np.testing.assert_array_equal(made.deltas[0], short.deltas[0])
    assert len(notes) == 1 and notes[0].startswith("eyeBlinkRight")


def test_halves_of_a_blink_are_lengthened_together(plain, openings) -> None:
    short = shortened(plain, 0.7)
    halves = replace(short, names=("eyeBlink_L", "eyeBlinkRight", "jawOpen"))
    made, _ = shut(halves, openings)
    np.testing.assert_allclose(made.deltas, shut(short, openings)[0].deltas)


def test_edges_are_angles_about_the_eye_over_even_places() -> None:
    a = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    rest = np.column_stack([12 * np.cos(a), 4 * np.sin(a), np.sqrt(169 - 16 * np.sin(a) ** 2 - 0 * a)])
    found = module.lid_edges(rest, np.arange(40), rest)
    np.testing.assert_allclose(found.x, np.linspace(-12, 12, 33))
    wanted = np.arctan2(
        4 * np.sqrt(np.maximum(1 - (found.x / 12) ** 2, 0)), np.sqrt(169 - 16 * np.maximum(1 - (found.x / 12) ** 2, 0))
    )
    np.testing.assert_allclose(found.upper, wanted, atol=0.02)
    np.testing.assert_allclose(found.lower, -wanted, atol=0.02)
    np.testing.assert_allclose(found.gap, found.upper - found.lower)
    moved = module.lid_edges(rest + np.array([0, 3.0, 0]), np.arange(40), rest)  # told apart at rest
    assert (moved.upper >= moved.lower - 1e-9).all() and moved.lower[16] < 0 < moved.lower[0]


def test_lids_turn_by_the_gap_and_an_overlap_that_fades_towards_the_corners(monkeypatch) -> None:
    """Closed form: the gap left and a millimetre more, of which the upper lid goes 85 hundredths."""
    monkeypatch.setattr(module, "SPREAD_COLUMNS", 0.5)
    x, radius = np.linspace(-13, 13, module.COLUMNS), 12.0
    opening = np.clip(1.0 - (x / 13) ** 2, 0.0, None)
    before = module.LidEdges(x, 0.5 * opening + 0.1, -0.3 * opening + 0.1)
    after = module.LidEdges(x, 0.2 * opening + 0.1, -0.1 * opening + 0.1)
    for at in (0.0, 6.5, -12.1875):
        share = 1.0 - (at / 13) ** 2
        need = 0.3 * share + min(4.0 * share, 1.0) / radius
        for opened, edge, way in (
            (0.5 * share + 0.1, 0.2 * share + 0.1, -0.85),
            (-0.3 * share + 0.1, -0.1 * share + 0.1, 0.15),
        ):
            rest, local = (np.array([[at, radius * np.sin(k), radius * np.cos(k)]]) for k in (opened, edge))
            more = module._lengthened(rest, local - rest, before, after, radius)
            turned = np.arctan2((local + more)[0, 1], (local + more)[0, 2]) - edge
            assert turned == pytest.approx(way * need, abs=1e-6), (at, way)
    none = np.array([[0.0, radius * np.sin(0.5 + 0.1 + 0.71), radius * np.cos(1.31)]])
    assert not module._lengthened(none, 0 * none, before, after, radius).any()  # a forehead does not turn
    ahead = np.array([[0.0, 24.5 * np.sin(0.6), 24.5 * np.cos(0.6)], [0.0, -11.6, 3.0]])
    assert not module._lengthened(ahead, 0 * ahead, before, after, radius).any()  # far before it; beside it


def test_what_is_missing_in_one_column_is_shared_by_those_beside_it() -> None:
    """Lengthened in one column alone, a lid would have a trench."""
    need = np.zeros(module.COLUMNS)
    need[10] = 2.0
    spread = module._spread(need)
    assert spread[10] == 2.0 and (np.diff(spread[:11]) >= 0).all() and (np.diff(spread[10:]) <= 0).all()
    assert np.abs(np.diff(spread)).max() < 0.4 and spread[10 + module.SPREAD_COLUMNS :].max() == 0.0
    np.testing.assert_array_equal(module._spread(np.full(5, 0.7)), 0.7)


def test_skin_that_the_blink_leaves_alone_stays_when_it_is_lengthened(plain, openings) -> None:
    """A lid's crease and the side of the nose are within reach of the lid, but do not move."""
    short = shortened(plain, 0.7)
    still = np.linalg.norm(short.deltas[0], axis=1) < 1e-9
    upper = plain.vertices[:, 1] > 40.5
    made, _ = shut(short, openings)
    assert not (made.deltas[0] - short.deltas[0])[still & upper].any()
    assert np.abs(made.deltas[0] - short.deltas[0])[~still & upper].max() > 1.0


def test_lids_are_told_apart_by_a_line_between_corners_that_need_not_be_level() -> None:
    a = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    slanted = np.column_stack([12 * np.cos(a), 3 * np.sin(a) + 2.5 * np.cos(a), 12 + 0 * a])
    found = module.lid_edges(slanted, np.arange(40), slanted)
    lift = np.sqrt(np.maximum(1 - (found.x / 12) ** 2, 0))
    np.testing.assert_allclose(found.upper, np.arctan2(3 * lift + 2.5 * found.x / 12, 12), atol=0.02)
    np.testing.assert_allclose(found.lower, np.arctan2(-3 * lift + 2.5 * found.x / 12, 12), atol=0.02)
