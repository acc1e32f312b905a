"""Names without a side mean both."""

from __future__ import annotations

import numpy as np

from controller.base.parameters import PARAMETERS as P
from controller.vocabulary.sides import sides, spread, unknown_names


def test_sides() -> None:
    assert sides(P, "mouthSmile") == [P.index("mouthSmileLeft"), P.index("mouthSmileRight")]
    assert sides(P, "jawOpen") == [P.index("jawOpen")]
    assert sides(P, "nothing") == []


def test_a_table_is_spread_over_both_sides() -> None:
    values = spread(P, {"mouthSmile": 0.5, "jawOpen": 0.25, "nothing": 1.0}, -1.0)
    assert np.flatnonzero(values == 0.5).tolist() == sides(P, "mouthSmile")
    assert values[P.index("jawOpen")] == 0.25 and (values == -1.0).sum() == len(P) - 3
    assert (spread(P, {}) == 0.0).all()


def test_unknown_names_are_faults_with_their_place() -> None:
    assert unknown_names(P, "here", ["mouthSmile", "jawOpen"]) == []
    assert unknown_names(P, "here", ["jawOpn", "xyz"]) == [
        "here.jawOpn: unknown parameter, did you mean 'jawOpen'?",
        "here.xyz: unknown parameter",
    ]
