"""Names without a side mean both."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest

from controller.base import parameters
from controller.base.parameters import PARAMETERS as P
from controller.base.parameters import Parameters
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


class Both:
    """A registry in which a name means a parameter that has sides as well."""

    names = ("lipLeft", "lip", "lipRight")

    def find(self, name: str) -> int | None:
        return self.names.index(name) if name in self.names else None


def test_a_name_that_is_a_parameter_means_no_sides() -> None:
    both = cast(Parameters, Both())
    assert sides(both, "lip") == [1] and sides(both, "lipRight") == [2] and sides(both, "brow") == []


def test_names_that_mean_something_cost_no_search_for_similar_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """That search took four fifths of the time in which a stage is read."""
    monkeypatch.setattr(parameters, "did_you_mean", lambda *_: pytest.fail("searched"))
    assert len(sides(P, "mouthSmile")) == 2 and unknown_names(P, "here", ["mouthSmile", "jawOpen"]) == []
