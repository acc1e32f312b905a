"""TOML that is written is read back as it was."""

import tomllib

from surface.head.model.tomltext import toml_text


def test_a_round_trip():
    table = {
        "format": 1, "name": 'a "quoted" name', "on": True, "x": 0.1, "none": [],
        "nested": {"list": [[1.5, 2.0], [3.0]], "deep": {"y": -1e-9}},
        "parts": [{"name": "a", "in": {"z": 1}}, {"name": "b"}],
    }  # fmt: skip
    assert tomllib.loads(toml_text(table)) == table
