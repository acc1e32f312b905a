"""Landmarks of the shipped head go where each FACS action unit moves them."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from surface.head import Head

UNITS = tomllib.loads((Path(__file__).parent / "action_units.toml").read_text(encoding="utf-8"))["unit"]
PARTS = ("face", "tongue", "eye_left", "eye_right")
NEIGHBOURS = 8


@pytest.fixture(scope="module")
def head(root) -> Head:
    return Head.load(root / "configs" / "heads" / "ict")


@pytest.fixture(scope="module")
def rest(head) -> dict[str, np.ndarray]:
    head.pose(head.values({}))
    return {name: head.part(name).vertices.astype(float) for name in PARTS}


@pytest.mark.parametrize("unit", UNITS, ids=[f"AU {u['au']}" for u in UNITS])
def test_landmarks_go_where_the_action_unit_moves_them(head, rest, unit):
    head.pose(head.values(dict.fromkeys(unit["set"], 1.0)))
    for move in unit["moves"]:
        part = move.get("part", "face")
        near = np.argsort(np.linalg.norm(rest[part] - move["at"], axis=1))[:NEIGHBOURS]
        gone = (head.part(part).vertices - rest[part])[near, "xyz".index(move["axis"])].mean()
        if "most" in move:
            assert abs(gone) < move["most"], move
        else:
            assert np.sign(move["least"]) * gone > abs(move["least"]), move
