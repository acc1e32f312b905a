"""benchmarks/many_servos.py, with few: it runs, and counts every servo."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import pytest


@pytest.fixture
def program(benchmark: Callable[[str], ModuleType]) -> ModuleType:
    return benchmark("many_servos")


def test_servos_without_ports(program: ModuleType) -> None:
    assert [len(chain.servos) for chain in program.buses(30, 24)] == [24, 6]
    table = program.without_ports(30)
    assert list(table.columns[1].cells) == ["2", "1"]


def test_servos_on_ports(program: ModuleType) -> None:
    assert next(iter(program.on_ports(size=5, count=2).columns[1].cells)) == "10"
