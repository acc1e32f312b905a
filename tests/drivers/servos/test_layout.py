"""drivers.servos.layout: short names are registers of some model, and a block decodes as its registers do."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.servos.layout import NAMES, block_of, item_of
from drivers.tables.tables import load_table

MODELS = ("ym070-210-a051", "xm430-w350", "xl320", "mx1-28", "ax-12a", "sts3215", "scs0009")


def test_every_short_name_is_a_register_of_some_model() -> None:
    tables = [load_table(model) for model in MODELS]
    assert [name for name in NAMES if all(item_of(table, name) is None for table in tables)] == []


def test_no_short_name_means_two_registers_of_one_model() -> None:
    tables = [load_table(model) for model in MODELS]
    both = [(t.model, name) for t in tables for name, vendors in NAMES.items() if sum(v in t for v in vendors) > 1]
    assert both == []


@pytest.mark.parametrize("model", MODELS)
def test_a_block_decodes_as_its_registers_do(model: str) -> None:
    block = block_of(load_table(model), "position", "velocity", "temperature")
    data = np.random.default_rng(1).integers(0, 4, (3, block.size), np.uint8)
    rows = block.decode(data)
    for name, item in block.items.items():
        at = item.address - block.address
        assert rows[name].tolist() == [item.decode(row[at : at + item.size].tobytes()) for row in data]
