"""Fits of servos against least squares and curves that made the pairs."""

from __future__ import annotations

import numpy as np
import pytest

from controller.robot.pairs import fit as module
from controller.robot.pairs.fit import FOLDS, MIN_PAIRS, FittedServo, FittedTerm, _Basis, fit_servo


def faces(count: int = 240, parameters: int = 4, low: float = 0.0) -> np.ndarray:
    """(count, parameters) smooth motion from ``low`` to 1, each at its own pace."""
    rng, t = np.random.default_rng(1), np.arange(count) / 30
    waves = [np.sin(t * rng.uniform(1.0, 4.0) + rng.uniform(0, 6)) for _ in range(parameters)]
    return low + (1.0 - low) * (0.5 + 0.5 * np.stack(waves, axis=1))


def test_angles_of_a_fit_are_its_rest_and_what_every_term_adds() -> None:
    terms = (FittedTerm(2, np.array([0.0, 0.5, 1.0]), np.array([0.0, 1.0, 9.0])),
             FittedTerm(0, np.array([-1.0, 1.0]), np.array([5.0, -5.0])))  # fmt: skip
    made = FittedServo(3.0, terms, 0.0, 0.0, 10.0)
    values = np.array([[0.0, 7.0, 0.0], [0.5, 7.0, 0.75], [-4.0, 7.0, 2.0]])
    np.testing.assert_allclose(made.angles(values), [3.0, 3.0 - 2.5 + 5.0, 3.0 + 5.0 + 9.0])
    np.testing.assert_array_equal(FittedServo(3.0, (), 0.0, 0.0, 0.0).angles(values), [3.0] * 3)


def test_weights_are_those_of_least_squares_and_the_rest_is_the_angle_at_zero() -> None:
    values = faces(low=-1.0)
    true = -4.0 + values @ [12.0, -7.0, 0.0, 3.0]
    found = fit_servo(values, true)
    oracle = np.linalg.lstsq(np.column_stack([values, np.ones(len(values))]), true, rcond=None)[0]
    weights = {
        term.parameter: float(np.ptp(term.gives) / np.ptp(term.at) * np.sign(term.gives[-1])) for term in found.terms
    }
    assert weights.keys() == {0, 1, 3}
    for parameter, weight in weights.items():
        assert weight == pytest.approx(oracle[parameter], abs=0.05)
    assert found.rest_deg == pytest.approx(-4.0, abs=0.1)
    assert found.span_deg == pytest.approx(np.ptp(true)) and found.alike == ()
    for term in found.terms:
        assert np.interp(0.0, term.at, term.gives) == pytest.approx(0.0, abs=1e-12)  # at 0 a parameter adds nothing
        assert len(term.at) == 2


def test_the_errors_of_a_fit_are_those_of_its_pairs_and_of_pairs_that_it_did_not_know() -> None:
    values = faces()
    true = 10.0 * values[:, 0] + np.random.default_rng(2).normal(scale=0.4, size=len(values))
    found = fit_servo(values, true)
    away = found.angles(values) - true
    assert found.rms_deg == pytest.approx(np.sqrt((away**2).mean()), rel=1e-6)
    assert away.mean() == pytest.approx(0.0, abs=1e-9)
    assert found.rms_deg < found.left_out_deg < 1.4 * found.rms_deg


def test_only_candidates_are_followed() -> None:
    values = faces()
    true = 10.0 * values[:, 0] + 5.0 * values[:, 1]
    assert {term.parameter for term in fit_servo(values, true, candidates=[1, 2, 3]).terms} <= {1, 2, 3}
    assert {term.parameter for term in fit_servo(values, true, candidates=[0, 1]).terms} == {0, 1}
    still = fit_servo(values, true, candidates=[])
    assert still.why_not == "no parameter moves in the pairs" and still.terms == ()
    assert still.rest_deg == np.median(true)


def test_a_falling_curve_falls_everywhere() -> None:
    values = faces()
    true = np.interp(values[:, 2], [0.0, 0.5, 1.0], [30.0, 29.0, 0.0])
    found = fit_servo(values, true + np.random.default_rng(5).normal(scale=0.3, size=len(true)))
    (term,) = found.terms
    assert term.parameter == 2 and len(term.at) == 5 and (np.diff(term.gives) <= 0.0).all()
    assert term.gives[0] == 0.0 and found.rest_deg == pytest.approx(30.0, abs=0.6)
    assert term.gives[-1] == pytest.approx(-30.0, abs=1.0)


def test_a_servo_and_a_parameter_that_hardly_move_say_nothing() -> None:
    values = faces()
    assert fit_servo(values, 0.049 * values[:, 0] / np.ptp(values[:, 0])).why_not == "it does not move in the pairs"
    assert not fit_servo(values, 0.051 * values[:, 0] / np.ptp(values[:, 0])).why_not
    still = np.full_like(values, 0.3)
    assert fit_servo(still, values[:, 0]).why_not == "no parameter moves in the pairs"


def test_a_term_too_small_to_matter_is_left_out() -> None:
    values = faces()
    found = fit_servo(values, 10.0 * values[:, 0] + 0.02 * values[:, 1])
    assert [term.parameter for term in found.terms] == [0]


def test_noise_is_not_taken_for_a_face() -> None:
    values = faces()
    noise = np.random.default_rng(4).normal(scale=10.0, size=len(values))
    found = fit_servo(values, noise)
    assert found.why_not == f"what was left out is only predicted to {found.left_out_deg:.2f} degrees (rms)"
    assert found.left_out_deg == pytest.approx(noise.std(), rel=0.3)
    half = fit_servo(values, 10.0 * values[:, 0] + 0.3 * noise)  # more than half is explained
    assert not half.why_not


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_too_few_pairs_and_numbers_that_are_none_are_refused(bad: float) -> None:
    values, deg = faces(MIN_PAIRS), np.linspace(0, 10, MIN_PAIRS)
    assert MIN_PAIRS == 20
    fit_servo(values, deg)
    with pytest.raises(ValueError, match="needs 20 pairs or more, all of finite numbers; there are 19"):
        fit_servo(values[1:], deg[1:])
    for spoilt in (values, deg):
        kept = spoilt.flat[5]
        spoilt.flat[5] = bad
        with pytest.raises(ValueError, match="finite numbers; there are 20"):
            fit_servo(values, deg)
        spoilt.flat[5] = kept


def test_blocks_that_are_left_out_follow_each_other_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five blocks, each predicted by the fit of the other four."""
    seen = []
    real = module._slopes

    def noting(basis: _Basis, inside: np.ndarray, deg: np.ndarray, penalty: float) -> tuple[np.ndarray, float]:
        seen.append(~inside)
        return real(basis, inside, deg, penalty)

    monkeypatch.setattr(module, "_slopes", noting)
    values = faces(23)
    deg, basis = values[:, 0] * 10.0, _Basis.over(values, 1)
    error = module._left_out(basis, deg, 1e-3)
    assert len(seen) == FOLDS == 5 and (np.sum(seen, axis=0) == 1).all()
    for out in seen:
        (places,) = np.nonzero(out)
        assert (np.diff(places) == 1).all() and 4 <= len(places) <= 5
    away = np.zeros(23)
    for out in seen:
        slopes, rest = real(basis, ~out, deg, 1e-3)
        away[out] = (basis.design @ slopes + rest - deg)[out]
    assert error == pytest.approx(np.sqrt((away**2).mean()))


def test_pieces_reach_from_zero_or_below_to_the_greatest_value() -> None:
    values = np.array([[0.2, -0.5], [1.0, 0.5], [0.6, 0.0]])
    basis = _Basis.over(values, 4)
    np.testing.assert_allclose(basis.knots, [[0, 0.25, 0.5, 0.75, 1.0], [-0.5, -0.25, 0.0, 0.25, 0.5]])
    assert basis.pieces == 4 and basis.design.shape == (3, 8)
    np.testing.assert_allclose(basis.design[0], [0.2, 0, 0, 0, 0, 0, 0, 0])
    np.testing.assert_allclose(basis.design[2], [0.25, 0.25, 0.1, 0, 0.25, 0.25, 0, 0])


def test_parameters_that_moved_as_one_are_named_in_pairs() -> None:
    values = faces()
    values[:, 3] = 1.0 - values[:, 0]
    found = fit_servo(values, 10.0 * values[:, 0] + 4.0 * values[:, 1])
    assert {frozenset(pair) for pair in found.alike} == {frozenset({0, 3})}
    assert all(a in {term.parameter for term in found.terms} for a, _ in found.alike)
