"""A real take of a phone goes through every format and comes back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.format import FORMATS
from controller.formats.frame import Frame
from controller.takes.livelink import Take
from tests.controller.formats.faces import KINDS, there_and_back, tolerance

EVERY = 20


@pytest.fixture(scope="module")
def take(shared: Path) -> Take:
    return Take.load(shared / "data" / "livelink" / "alex_rom_3.csv", P)


@pytest.mark.parametrize("kind", KINDS)
def test_a_real_take_goes_there_and_back(kind: str, take: Take) -> None:
    form = FORMATS.get(kind)
    rows = take.values[::EVERY]
    sent = [Frame(row, take.mask, float(time_s)) for time_s, row in zip(take.times_s[::EVERY], rows, strict=True)]
    found = there_and_back(form, sent)
    found = found[len(found) // len(sent) - 1 :: len(found) // len(sent)]  # some send a face as several messages
    assert len(found) == len(sent) > 200
    carried = form.carries(P) & take.mask
    values = np.array([frame.values for frame in found])
    np.testing.assert_allclose(values[:, carried], rows[:, carried], atol=tolerance(form))
    times = [frame.time_s for frame in found]
    if None not in times:
        assert np.abs(np.diff(times) - np.diff(take.times_s[::EVERY])).max() < 1 / 60
