"""controller.takes.edit"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from controller.base.errors import ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.takes.edit import cut_out, keep, layer_over, smooth
from controller.takes.livelink import Take
from controller.takes.plain import plain_take, write_plain

JAW, BROW = P.index("jawOpen"), P.index("browInnerUp")


def take(column: int, values: np.ndarray, hz: float = 10.0) -> Take:
    table, mask = np.zeros((len(values), len(P))), np.zeros(len(P), bool)
    table[:, column], mask[column] = values, True
    return Take("a", np.arange(len(values)) / hz, table, mask, P.low, P.high)


RAMP = take(JAW, np.linspace(0.0, 1.0, 11))


def test_a_range_is_kept_with_its_ends() -> None:
    part = keep(RAMP, 0.25, 0.62)
    assert part.times_s == pytest.approx([0.0, 0.05, 0.15, 0.25, 0.35, 0.37])
    assert part.values[:, JAW] == pytest.approx([0.25, 0.3, 0.4, 0.5, 0.6, 0.62])
    assert RAMP.frames == 11 and not part.values.flags.writeable
    assert keep(RAMP, 5.0, -5.0).times_s == pytest.approx(RAMP.times_s)
    with pytest.raises(ParameterError, match="no part"):
        keep(RAMP, 3.0, 4.0)


def test_a_range_is_cut_out_and_the_rest_joined() -> None:
    rest = cut_out(RAMP, 0.35, 0.75, join_s=0.1)
    assert np.all(np.diff(rest.times_s) > 0) and rest.duration_s == pytest.approx(1.0 - 0.4 + 0.1)
    assert rest.values[:, JAW] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.35, 0.75, 0.8, 0.9, 1.0])
    assert cut_out(RAMP, 0.0, 0.5).values[0, JAW] == pytest.approx(0.5)
    assert cut_out(RAMP, 0.5, 9.0).duration_s == pytest.approx(0.5)
    with pytest.raises(ParameterError, match="nothing would be left"):
        cut_out(RAMP, 0.0, 1.0)


def test_smoothing_is_a_gaussian_that_keeps_the_ends() -> None:
    noisy = take(JAW, np.random.default_rng(1).uniform(0, 1, 400), hz=60.0)
    found = smooth(noisy, 0.05).values[:, JAW]
    wanted = gaussian_filter1d(noisy.values[:, JAW], 0.05 * 60.0, truncate=4.0)
    assert found[20:-20] == pytest.approx(wanted[20:-20], abs=2e-3)
    assert found[0] == noisy.values[0, JAW] and found[-1] == noisy.values[-1, JAW]
    assert smooth(RAMP, 0.1).values[3:-3, JAW] == pytest.approx(RAMP.values[3:-3, JAW], abs=0.02)
    with pytest.raises(ParameterError):
        smooth(RAMP, 0.0)


def test_a_layer_moves_its_parameters_while_it_lasts(tmp_path: Path) -> None:
    both = layer_over(RAMP, take(BROW, np.array([1.0, 0.5, 1.0])), offset_s=0.35)
    assert both.mask[[JAW, BROW]].all() and both.mask.sum() == 2
    at = lambda time_s: both.values[np.argmin(np.abs(both.times_s - time_s))]  # noqa: E731
    assert at(0.45)[[JAW, BROW]] == pytest.approx([0.45, 0.5]) and at(0.8)[BROW] == 0.0 and at(0.1)[BROW] == 0.0
    write_plain(tmp_path / "both.csv", both.times_s, both.values, both.mask, P)
    again = plain_take(tmp_path / "both.csv", P)
    assert again.values[:, [JAW, BROW]] == pytest.approx(both.values[:, [JAW, BROW]], abs=1e-5)
    with pytest.raises(ParameterError):
        layer_over(RAMP, RAMP, offset_s=2.0)
