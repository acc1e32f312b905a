"""What is put on top of a fitted head."""

import numpy as np
from slit_sheet import slit_sheet
from small_head import small_head

from surface.fit.features.finish import finish_head
from surface.fit.points.recipe import Recipe
from surface.head import Head
from surface.head.model.file import load_data
from surface.head.model.parameters import SHAPES


def test_a_head_without_openings_stays_as_it_is():
    head = small_head()
    assert finish_head(head, slit_sheet(), {}, Recipe([])) is head


def test_the_shipped_head_stands_at_rest_where_its_contacts_put_it(root):
    head = Head(load_data(root / "configs" / "heads" / "ict"))
    before = {p.name: p.vertices.copy() for p in head.parts}
    head.pose(head.values({"jawOpen": 1.0, "eyeBlinkLeft": 1.0}))
    head.pose(head.values({}))
    for part in head.parts:
        assert np.abs(part.vertices - before[part.name]).max() < 0.3, part.name


def test_the_shipped_head_has_a_rule_for_every_group_that_is_no_parameter(root):
    data = load_data(root / "configs" / "heads" / "ict")
    extra = {g.name for p in data.parts for g in p.groups if g.name not in SHAPES}
    assert extra == {r.group for r in data.rules}
