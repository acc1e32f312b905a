"""surface.head.model.own_groups: amounts of a user's own groups from the values of a face."""

from __future__ import annotations

import numpy as np
import pytest

from surface.head.model.own_groups import OwnAmounts, OwnGroup
from surface.head.model.parameters import NAMES


def group(name: str, *times: str) -> OwnGroup:
    return OwnGroup(name, "face", np.array([0]), np.zeros((1, 3)), times)


def test_a_group_is_moved_by_the_parameter_of_its_name() -> None:
    amounts = OwnAmounts([group("ears"), group("nose"), group("ears")])
    assert amounts.names == (*NAMES, "ears", "nose")
    values = np.zeros(len(NAMES) + 2)
    values[-2:] = 0.3, -0.4
    np.testing.assert_array_equal(amounts(values), [0.3, -0.4, 0.3])


def test_amounts_are_within_1_to_either_side_and_factors_within_0_and_1() -> None:
    amounts = OwnAmounts([group("a"), group("b", "a", "mouthPucker"), group("c", "mouthPucker")])
    pucker = NAMES.index("mouthPucker")
    for a, b, c, factor, wanted in (
        (2.0, -3.0, 0.5, 0.5, [1.0, -0.5, 0.25]), (0.5, 1.0, 1.0, 7.0, [0.5, 0.5, 1.0]),
        (-0.5, 1.0, 1.0, 0.5, [-0.5, 0.0, 0.5]), (1.0, 0.8, -1.0, -0.1, [1.0, 0.0, 0.0]),
    ):  # fmt: skip
        values = np.zeros(len(NAMES) + 3)
        values[-3:], values[pucker] = (a, b, c), factor
        np.testing.assert_allclose(amounts(values), wanted)
        assert values[-3] == a  # what was given stays


def test_what_is_no_parameter_or_no_number_is_named() -> None:
    with pytest.raises(ValueError, match="b: 'wink' is no parameter of the head"):
        OwnAmounts([group("a"), group("b", "wink")])
    values = np.zeros(len(NAMES) + 2)
    values[-1] = np.nan
    with pytest.raises(ValueError, match="values: b is not a number"):
        OwnAmounts([group("a"), group("b")])(values)
