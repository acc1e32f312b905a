"""Rules move groups that are no parameters."""

import numpy as np
import pytest
from small_head import all_points, part, small_head

from surface.base.errors import HeadFileError
from surface.head import Head, Rule
from surface.head.model.data import Seal
from surface.head.model.file import load_data, save_data
from surface.head.model.parameters import SHAPES
from surface.head.model.rules import Drivers, SealDriver


def shapes(**given: float) -> np.ndarray:
    return np.array([given.get(n, 0.0) for n in SHAPES])


def test_terms_are_multiplied_and_raised():
    d = Drivers([Rule("crease", ({"mouthSmileLeft": 0.5, "noseSneerLeft": 1.0},), 2.0),
                 Rule("mend", ({"jawOpen": 1.0}, {"mouthPucker": 1.0}))])  # fmt: skip
    a = d.amounts(shapes(mouthSmileLeft=0.6, noseSneerLeft=0.1, jawOpen=0.5, mouthPucker=0.4))
    assert d.names[-2:] == ("crease", "mend")
    np.testing.assert_allclose(a[-2:], [0.16, 0.2])
    assert d.amounts(shapes(mouthSmileLeft=1, noseSneerLeft=1))[-2] == 1.0


def test_without_rules_there_are_the_shapes_only():
    np.testing.assert_array_equal(Drivers([]).amounts(shapes(jawOpen=0.3)), shapes(jawOpen=0.3))


def test_a_wrong_name_is_named():
    with pytest.raises(HeadFileError, match=r"rules\[0\]: no shape 'smirk'"):
        Drivers([Rule("x", ({"smirk": 1.0},))])


def test_a_rule_moves_its_group_and_survives_the_file(tmp_path):
    data = small_head(parts=[part("a", 0, groups=[all_points("fold", (0, 0, 4))])], seams=[])
    from dataclasses import replace

    save_data(tmp_path, replace(data, rules=[Rule("fold", ({"browInnerUp": 1.0},), 2.0)]))
    assert load_data(tmp_path).rules == [Rule("fold", ({"browInnerUp": 1.0},), 2.0)]
    head = Head.load(tmp_path)
    rest = head.part("a").vertices.copy()
    head.pose(head.values({"browInnerUp": 0.5}))
    np.testing.assert_allclose((head.part("a").vertices - rest)[:, 2], 1.0, atol=1e-5)


def test_a_seal_opens_smoothly_with_the_greater_side():
    driver = SealDriver(Seal({"jawOpen": 2.0, "mouthUpperUpLeft": 1.0, "mouthUpperUpRight": 1.0, "mouthPucker": -0.5},
                             0.4, 0.8))  # fmt: skip
    assert driver.amount(shapes()) == driver.amount(shapes(jawOpen=0.2)) == 1.0
    assert driver.amount(shapes(jawOpen=0.3)) == pytest.approx(0.5)
    assert driver.amount(shapes(jawOpen=0.4)) == driver.amount(shapes(mouthUpperUpRight=0.8)) == 0.0
    assert driver.amount(shapes(mouthUpperUpLeft=0.4, mouthUpperUpRight=0.4)) == 1.0  # sides do not add up
    assert driver.amount(shapes(mouthUpperUpLeft=1.0, mouthPucker=0.8)) == pytest.approx(0.5)
    assert SealDriver(None).amount(shapes(jawOpen=0.1)) == 0.0


def test_lips_are_rounded_by_a_pucker_that_keeps_them_together() -> None:
    driver = SealDriver(Seal({"jawOpen": 3.6, "mouthPucker": -0.35}, 0.45, 1.0))
    assert driver.rounding(shapes(jawOpen=1.0, mouthSmileLeft=1.0)) == 0.0
    assert driver.rounding(shapes(mouthPucker=0.5)) == pytest.approx(0.6)
    assert driver.rounding(shapes(mouthFunnel=0.5)) == pytest.approx(0.35)
    assert driver.rounding(shapes(mouthPucker=1.0, mouthFunnel=1.0)) == 1.0
    assert driver.rounding(shapes(mouthPucker=1.0, tongueOut=0.5)) == pytest.approx(0.2)
    assert driver.rounding(shapes(mouthPucker=1.0, tongueOut=1.0)) == 0.0
    assert driver.rounding(shapes(mouthPucker=1.0, jawOpen=0.3)) == 1.0
    assert driver.rounding(shapes(mouthPucker=1.0, jawOpen=0.55)) == pytest.approx(0.5)
    assert driver.rounding(shapes(mouthPucker=1.0, jawOpen=0.9)) == 0.0
    assert driver.rounding(shapes(mouthPucker=1.0, jawOpen=0.9, mouthClose=0.6)) == 1.0
    drawn = SealDriver(Seal({"jawOpen": 3.6, "mouthPucker": 1.4}, 0.45, 1.0))  # a round open mouth by itself
    assert drawn.rounding(shapes(mouthPucker=1.0)) == SealDriver(None).rounding(shapes(mouthPucker=1.0)) == 0.0
