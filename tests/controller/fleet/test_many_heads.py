"""benchmarks/many_heads.py: how many faces were sent, from those that were taken."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

pytest.importorskip("zenoh", reason="pip install 'omote[zenoh]'")

from controller.fleet.lease import Token

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
from many_heads import faces_sent

FIRST, SECOND, AGAIN = Token(1, 8), Token(2, 5), Token(3, 8)


def test_each_term_of_a_conductor_counts_its_own_faces() -> None:
    taken = [(FIRST, 900), (FIRST, 903), (SECOND, 1), (SECOND, 2), (AGAIN, 950), (AGAIN, 952)]
    assert faces_sent(taken) == 4 + 2 + 3
    assert faces_sent(taken[:1]) == 1 and faces_sent([]) == 0
