"""controller.stage.pulling, measured on the head itself and not on the samples that the solver sees."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.base.paths import find_config
from controller.robot.anchors import SkinSamples, head_order, sample_skin, skin_points
from controller.stage import pulling as module
from controller.stage.pulling import Pin, PullSolver, Slopes, lip_pairs
from surface.head import Head
from surface.spline.matrix import basis_rows

AHEAD = np.array([0.0, 0.0, 1.0])
LIPS_SEALED_MM, OTHER_SIDE_MM = 0.6, 1.0


@dataclass
class Bench:
    """A head, its samples, and where its points really are in a face."""

    head: Head
    skin: SkinSamples
    lips: tuple[SkinSamples, int]

    def __post_init__(self) -> None:
        self.order = head_order(self.head.parameters, P)
        self._part = self.head.parts.index(self.head.part("face"))

    def near(self, place: tuple[float, float, float]) -> int:
        return int(np.argmin(np.linalg.norm(self.skin.rest - place, axis=1)))

    def solver(self, start: np.ndarray | None = None, *, tied: bool = False) -> PullSolver:
        return PullSolver(self.skin, self.lips, self.order, P, P.neutral() if start is None else start, tied=tied)

    def places(self, uv: np.ndarray, values: np.ndarray) -> np.ndarray:
        basis = basis_rows(self.head.part("face").surface, uv)
        return np.asarray(basis @ self.head.place_points(values[self.order])[0][self._part])

    def moved(self, point: int, values: np.ndarray) -> np.ndarray:
        uv = self.skin.uv[point : point + 1]
        return np.asarray(self.places(uv, values) - self.places(uv, P.neutral()))[0]

    def opened(self, values: np.ndarray) -> float:
        """How much the lips have parted, mm, where most."""
        gap = [np.linalg.norm(np.subtract(*np.split(self.places(self.lips[0].uv, v), 2)), axis=1)
               for v in (values, P.neutral())]  # fmt: skip
        return float((gap[0] - gap[1]).max())

    def pull(self, point: int, by: tuple[float, float, float], **options: bool) -> np.ndarray:
        """Pull a point in ten steps, as a mouse does."""
        solver = self.solver(**options)
        for share in np.linspace(0.1, 1.0, 10):
            values = solver.solve([Pin(point, self.skin.rest[point] + share * np.array(by), AHEAD)])
        return values


@pytest.fixture(scope="module")
def bench() -> Bench:
    head = Head.load(find_config("heads", "ict"))
    skin = sample_skin(head, "face", skin_points(head, "face", 900, 11))
    return Bench(head, skin, lip_pairs(head, "face"))


LEFT, RIGHT, BROW, CHEEK, CHIN, LID = (
    (28.6, -34.0, 102.0), (-28.6, -34.0, 102.0), (25.0, 53.0, 103.0), (46.0, -17.0, 91.0), (4.0, -71.0, 108.0),
    (32.0, 40.0, 97.0),
)  # fmt: skip


@pytest.mark.parametrize(
    ("at", "by", "does"),
    [
        (LEFT, (0.0, 8.0, 0.0), "mouthSmileLeft"),
        (RIGHT, (0.0, 8.0, 0.0), "mouthSmileRight"),
        (LEFT, (0.0, -6.0, 0.0), "mouthFrownLeft"),
        (RIGHT, (0.0, -6.0, 0.0), "mouthFrownRight"),
        (BROW, (0.0, 6.0, 0.0), "browOuterUpLeft"),
        (CHEEK, (0.0, 4.0, 0.0), "cheekSquintLeft"),
        (CHIN, (0.0, -12.0, 0.0), "jawOpen"),
    ],
)
def test_a_pulled_point_arrives_and_the_rest_stays(
    bench: Bench, at: tuple[float, float, float], by: tuple[float, float, float], does: str
) -> None:
    point = bench.near(at)
    values = bench.pull(point, by)
    away = bench.moved(point, values)[:2] - by[:2]
    assert np.linalg.norm(away) < 1.0
    assert values[P.index(does)] > 0.15 and (np.abs(values) > 0.02).sum() <= 8
    assert np.all((values >= P.low) & (values <= P.high)) and not values[P.index("headYaw")]
    if at is not CHIN:
        assert bench.opened(values) < LIPS_SEALED_MM
    if at in (LEFT, RIGHT):
        across = bench.near((-at[0], at[1], at[2]))
        assert np.linalg.norm(bench.moved(across, values)) < OTHER_SIDE_MM


def test_who_pulls_the_upper_lid_down_closes_it_and_does_not_sink_the_brow(bench: Bench) -> None:
    lid, brow = bench.near(LID), bench.near(BROW)
    values = bench.pull(lid, (0.0, -6.0, 0.0))
    assert np.abs(bench.moved(lid, values)[1] + 6.0) < 1.0  # a lid also goes inwards as it closes
    assert np.linalg.norm(bench.moved(brow, values)) < 0.5 and not values[P.index("browDownLeft")]


def test_who_pulls_the_brow_down_lowers_it_and_leaves_nose_and_cheek(bench: Bench) -> None:
    point = bench.near(BROW)
    values = bench.pull(point, (0.0, -4.0, 0.0))
    assert values[P.index("browDownLeft")] > 0.15 and bench.moved(point, values)[1] < -1.5
    assert not values[[P.index("noseSneerLeft"), P.index("cheekSquintLeft")]].any()


def test_both_sides_change_alike_where_they_are_tied(bench: Bench) -> None:
    values = bench.pull(bench.near(LEFT), (3.0, 6.0, 0.0), tied=True)
    mirrored = values[P.mirror()]
    aside = [P.index(name) for name in ("jawLeft", "mouthLeft")]
    assert np.allclose(np.delete(values, aside), np.delete(mirrored, aside)) and not values[aside].any()
    assert values[P.index("mouthSmileRight")] > 0.3


def test_pinned_points_stay_while_another_is_pulled(bench: Bench) -> None:
    left, right = bench.near(LEFT), bench.near(RIGHT)
    first = bench.pull(left, (4.0, 6.0, 0.0))
    solver, pinned = bench.solver(first), bench.skin.rest[left] + bench.moved(left, first)
    for share in np.linspace(0.1, 1.0, 10):
        goal = bench.skin.rest[right] + share * np.array([-2.0, -5.0, 0.0])
        values = solver.solve([Pin(left, pinned), Pin(right, goal, AHEAD)])
    assert np.linalg.norm(bench.moved(right, values)[:2] - [-2.0, -5.0]) < 1.2
    assert np.linalg.norm(bench.moved(left, values) - bench.moved(left, first)) < 1.2
    assert values[P.index("mouthFrownRight")] > 0.2 and values[P.index("mouthSmileLeft")] > 0.3


def test_what_no_face_reaches_changes_little_and_is_told(bench: Bench) -> None:
    point, solver = bench.near((0.0, 20.0, 115.0)), bench.solver()
    values = solver.solve([Pin(point, bench.skin.rest[point] + [0.0, 40.0, 0.0], AHEAD)])
    assert solver.missed_mm > 20.0 and (np.abs(values) > 0.02).sum() <= 6
    assert solver.solve([Pin(point, bench.skin.rest[point], AHEAD)]) == pytest.approx(P.neutral(), abs=0.02)


def test_lips_that_are_open_may_go_where_they_like(bench: Bench) -> None:
    open_ = P.neutral()
    open_[P.index("jawOpen")] = 0.5
    assert bench.solver(open_)._lips is None and bench.solver()._lips is not None


def test_a_head_without_contacts_has_no_lips_to_keep_closed(small: Callable[[], Head]) -> None:
    samples, pairs = lip_pairs(small(), small().parts[0].name)
    assert pairs == 0 and len(samples.rest) == 0
    assert solver_of(made([[0, 0, 0]], {"a": [[1, 0, 0]]}), "jawOpen")._lips is None


@pytest.fixture
def small() -> Callable[[], Head]:
    from tests.surface.small_head import small_head

    return lambda: Head(small_head())


def test_where_the_chin_is_pulled_only_what_the_jaw_carries_is_let_go(bench: Bench) -> None:
    solver = bench.solver()
    solver.solve([Pin(bench.near(CHIN), bench.skin.rest[bench.near(CHIN)], AHEAD)])
    jaw, weights = solver._staying.jaw, solver._stay_weights[::3, 0]
    share = np.clip(jaw / 0.68, 0.0, 1.0)
    assert (share < 0.01).any() and (share > 0.5).any()
    own = share < 1.0  # the jaw alone carries the others
    assert set(np.round(weights[own] / (1.0 - share[own]), 9)) <= {0.25, 0.8} and not weights[~own].any()
    solver.solve([Pin(bench.near(BROW), bench.skin.rest[bench.near(BROW)], AHEAD)])
    assert set(solver._stay_weights.ravel()) <= {0.25, 0.8}


def test_a_pin_counts_what_is_seen_of_a_way() -> None:
    free, seen = Pin(0, np.array([1.0, 2.0, 3.0])), Pin(0, np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.0, -5.0]))
    assert (free.weights(0.1) == np.eye(3)).all()
    np.testing.assert_allclose(seen.weights(0.1), np.diag([1.0, 1.0, 0.1]))
    aslant = Pin(0, np.zeros(3), np.array([3.0, 0.0, 4.0])).weights(0.25)
    np.testing.assert_allclose(aslant @ [0.6, 0.0, 0.8], [0.15, 0.0, 0.2])
    np.testing.assert_allclose(aslant @ [0.8, 0.0, -0.6], [0.8, 0.0, -0.6])
    place = np.array([4.0, 6.0, 99.0])
    assert seen.miss(place) == pytest.approx(5.0) and free.miss(place) == pytest.approx(np.hypot(5.0, 96.0))
    assert Pin(0, np.zeros(3), np.zeros(3)).miss(np.array([0.0, 3.0, 4.0])) == pytest.approx(5.0)  # no line of sight


def made(rest: list[list[float]], moves: dict[str, list[list[float]]], jaw: list[float] | None = None) -> SkinSamples:
    """Samples that shapes, whose order is that of ``moves``, move evenly."""
    by_shape = np.stack([np.array(each, float) for each in moves.values()], axis=2)
    every = np.repeat(by_shape[..., None], 4, axis=3) / 4.0
    follows = np.array(jaw or [0.0] * len(rest))
    return SkinSamples("face", np.zeros((len(rest), 2)), np.array(rest, float), every, follows)


def order_of(*names: str) -> np.ndarray:
    return P.indices(names)


def test_slopes_are_those_of_the_quarter_that_a_shape_is_in() -> None:
    samples = made([[0, 0, 0]], {"jawOpen": [[0, -8, 0]], "browInnerUp": [[4, 0, 0]]})
    samples.moves[0, 1, 0] = [-1.0, -2.0, -2.5, -2.5]
    for value, slope in ((0.0, -4.0), (0.24, -4.0), (0.26, -8.0), (0.6, -10.0), (1.0, -10.0)):
        found = Slopes(samples)(np.array([value, 0.5]))
        np.testing.assert_allclose(found, [[[0.0, 4.0], [slope, 0.0], [0.0, 0.0]]])
    np.testing.assert_allclose(module._max_displacements(samples), [8.0, 4.0])
    assert module._max_displacements(samples.subset(slice(0, 0))).tolist() == [0.0, 0.0]


def test_the_gap_goes_from_the_lower_lip_to_the_upper() -> None:
    rims = np.array([[0, 5.0, 0], [1, 5, 0], [0, 1, 0], [1, 2, 0]])
    np.testing.assert_allclose(module._gap(rims), [[0, 4, 0], [0, 3, 0]])


def test_both_sides_are_tied_in_pairs_and_what_goes_aside_not_at_all() -> None:
    names = ("mouthSmileLeft", "jawLeft", "browInnerUp", "mouthSmileRight", "mouthRight")
    ties = module._ties(P, order_of(*names))
    assert ties.shape == (5, 2)
    assert {tuple(np.flatnonzero(column)) for column in ties.T} == {(0, 3), (2,)} and set(ties.ravel()) == {0.0, 1.0}


def solver_of(samples: SkinSamples, *names: str, start: dict[str, float] | None = None, **options: bool) -> PullSolver:
    values = P.neutral()
    for name, value in (start or {}).items():
        values[P.index(name)] = value
    return PullSolver(samples, (samples.subset(slice(0, 0)), 0), order_of(*names), P, values, **options)


def test_changes_are_bounded_by_what_is_left_of_each_range_and_tied_ones_by_both() -> None:
    samples = made([[0, 0, 0]], {"a": [[1, 0, 0]], "b": [[1, 0, 0]]})
    start = {"mouthSmileLeft": 0.25, "mouthSmileRight": 0.75}
    free = solver_of(samples, "mouthSmileLeft", "mouthSmileRight", start=start)
    assert free._low.tolist() == [-0.25, -0.75] and free._high.tolist() == [0.75, 0.25]
    tied = solver_of(samples, "mouthSmileLeft", "mouthSmileRight", start=start, tied=True)
    assert tied._low.tolist() == [-0.25] and tied._high.tolist() == [0.25]


def test_points_near_a_pin_do_not_stay_and_its_other_side_does() -> None:
    rest = [[60.0, 0, 0], [33.0, 0, 0], [31.0, 0, 0], [-59.0, 0, 0], [0, 0, 0], [10.0, 0, 0]]
    samples = made(rest, {"a": [[1, 0, 0]] * 6})
    solver = solver_of(samples, "mouthSmileLeft")
    chosen = np.array([0])
    assert solver._points_to_keep(chosen).tolist() == [2, 3, 4, 5]  # beyond 28 mm
    assert solver._mirrored_points(chosen).tolist() == [3]
    assert solver._mirrored_points(np.array([5])).tolist() == []  # its mirror image is as near as itself
    assert solver_of(samples, "mouthSmileLeft", tied=True)._mirrored_points(chosen).tolist() == []


def test_only_shapes_that_are_at_home_at_a_pin_take_part() -> None:
    """A shape that moves another place more than three times as far belongs there, and gaze takes no part at all."""
    rest = [[40.0, 0, 0], [-40.0, 0, 0]]
    names = ("mouthSmileLeft", "cheekPuff", "browInnerUp", "eyeLookUpLeft", "noseSneerLeft")
    moves = {
        "here": [[0, 5, 0], [0, 5, 0]], "nearly": [[0, 3.1, 0], [0, 10, 0]], "elsewhere": [[0, 2.9, 0], [0, 10, 0]],
        "gaze": [[0, 9, 0], [0, 9, 0]], "hardly": [[0, 0.39, 0], [0, 0.39, 0]],
    }  # fmt: skip
    solver = solver_of(made(rest, moves), *names)
    solver._prepare((0,))
    assert solver._free.tolist() == [0, 1]
    far = solver_of(made(rest, {"a": [[0, 1, 0], [0, 10, 0]], "b": [[0, 2, 0], [0, 10, 0]]}), *names[:2])
    far._prepare((0,))
    assert far._free.tolist() == [1]  # where none is at home, the one that is most so


def test_a_pull_reaches_its_goal_by_the_shape_that_goes_there_and_says_what_is_missing() -> None:
    rest = [[40.0, 0, 0], [-40.0, 0, 0], [0.0, 60, 0]]
    samples = made(rest, {"up": [[0, 8, 0], [0, 0, 0], [0, 0, 0]], "aside": [[8, 0, 0], [8, 0, 0], [8, 0, 0]]})
    solver = solver_of(samples, "mouthSmileLeft", "cheekPuff")
    found = solver.solve([Pin(0, np.array([40.0, 6.0, 0.0]), np.array([0.0, 0, 1]))])
    assert 5.1 / 8 < found[P.index("mouthSmileLeft")] < 6.1 / 8 and found[P.index("cheekPuff")] < 0.02
    assert solver.missed_mm <= module.CLOSE_MM
    found = solver.solve([Pin(0, np.array([40.0, 20.0, 0.0]), np.array([0.0, 0, 1]))])
    assert found[P.index("mouthSmileLeft")] == pytest.approx(1.0) and solver.missed_mm == pytest.approx(12.0, abs=0.01)


def test_slopes_are_found_again_only_where_a_shape_reaches_another_level(bench: Bench) -> None:
    skin, made = bench.skin.subset(slice(0, 20)), []
    slopes = Slopes(skin, lambda moves: made.append(1) or 2.0 * moves)  # type: ignore[func-returns-value]
    count, levels = skin.moves.shape[2:]
    x = np.full(count, 0.3 / levels)
    first = slopes(x)
    assert slopes(1.5 * x) is first and len(made) == 1
    step = 1e-6 * np.eye(count)[3]
    for at in (x, x + 1.0 / levels * np.eye(count)[3]):
        wanted = (skin.displacement(at + step) - skin.displacement(at)) / 1e-6
        assert slopes(at)[:, :, 3] == pytest.approx(2.0 * wanted, abs=1e-3)
    assert len(made) == 2
