"""Names without a side mean both."""

from __future__ import annotations

import numpy as np

from controller.base.parameters import PARAMETERS as P
from controller.vocabulary.sides import sides, spread


def test_sides() -> None:
    assert sides(P, "mouthSmile") == [P.index("mouthSmileLeft"), P.index("mouthSmileRight")]
    assert sides(P, "jawOpen") == [P.index("jawOpen")]
    assert sides(P, "nothing") == []


def test_a_table_is_spread_over_both_sides_and_says_what_is_wrong() -> None:
    faults: list[str] = []
    values = spread(P, "here", {"mouthSmile": 0.5, "nothing": 1.0, "jawOpen": 2.0}, -1.0, faults)
    assert np.flatnonzero(values == 0.5).tolist() == sides(P, "mouthSmile")
    assert (np.delete(values, sides(P, "mouthSmile")) == -1.0).all()
    assert [fault.split(":")[0] for fault in faults] == ["here.nothing", "here.jawOpen"]
