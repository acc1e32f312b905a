"""Mends are worth the product of two shapes."""

import numpy as np
import pytest
from face_measures import lips_gap
from small_head import all_points, part, small_head

from surface.fit.features.correctives import add_correctives
from surface.head import Head

LEFT, UP = (4.0, 0.0, 0.0), (0.0, 6.0, 0.0)


@pytest.fixture
def mended():
    groups = [all_points("mouthLeft", LEFT), all_points("mouthShrugLower", UP)]
    head = small_head(parts=[part("a", -40, groups=groups), part("b", 0.5)], seams=[])
    return add_correctives(head, [{"of": ["mouthLeft", "mouthShrugLower"], "less": {"mouthShrugLower": 0.4}}])


@pytest.mark.parametrize(("one", "other"), [(0, 0), (1, 0), (0, 1), (1, 1), (0.5, 0.5), (0.25, 1)])
def test_a_share_is_taken_back_by_the_product(mended, one, other):
    head = Head(mended)
    rest = head.part("a").control_points.copy()
    head.pose(head.values({"mouthLeft": one, "mouthShrugLower": other}))
    wanted = np.array(LEFT) * one + np.array(UP) * (other - 0.4 * one * other)
    np.testing.assert_allclose(head.part("a").control_points - rest, np.tile(wanted, (25, 1)), atol=1e-5)


def test_parts_that_neither_shape_moves_get_no_group(mended):
    assert [g.name for g in mended.parts[0].groups][-1] == "mouthLeft*mouthShrugLower"
    assert mended.parts[1].groups == []
    assert [(r.group, r.power) for r in mended.rules] == [("mouthLeft*mouthShrugLower", 1.0)]


def test_rolled_lips_stay_together(root):
    head = Head.load(root / "configs" / "heads" / "ict")
    head.pose(head.values({"mouthRollLower": 1.0, "mouthRollUpper": 1.0}))
    assert lips_gap(head) < 0.45
