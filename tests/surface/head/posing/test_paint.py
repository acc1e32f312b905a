"""Paint in (u, v)."""

import numpy as np
import pytest

from surface.base.errors import HeadFileError
from surface.head.posing.paint import BASE, paint_part

UV = np.stack(np.meshgrid(np.linspace(0, 1, 21), np.linspace(0, 1, 21)), axis=-1).reshape(-1, 2)


def layer(**other) -> dict:
    return {"part": "face", "attribute": "occlusion", "value": [0.0], "feather": 0.1, **other}


def painted(*layers: dict) -> np.ndarray:
    return paint_part(list(layers), "face", UV, "head.toml")["occlusion"][:, 0]


def test_all():
    assert (painted(layer(kind="all", amount=0.25)) == 0.75).all()


def test_a_band_fades_with_distance():
    got = painted(layer(kind="band", lines=[[[0.5, 0.0], [0.5, 1.0]]], width=0.1))
    far = np.abs(UV[:, 0] - 0.5)
    assert (got[far < 0.1] == 0).all() and (got[far > 0.2 + 1e-9] == 1).all()
    np.testing.assert_allclose(got[np.isclose(far, 0.15)], 0.5, atol=1e-6)


def test_a_region_is_full_inside():
    got = painted(layer(kind="region", lines=[[[0.2, 0.2], [0.8, 0.2], [0.8, 0.8], [0.2, 0.8]]]))
    inside = (np.abs(UV - 0.5) < 0.3).all(axis=1)
    assert (got[inside] == 0).all() and (got[(np.abs(UV - 0.5) > 0.41).any(axis=1)] == 1).all()


def test_a_region_with_a_width_below_0_fades_across_its_edge():
    square = [[0.2, 0.2], [0.8, 0.2], [0.8, 0.8], [0.2, 0.8]]
    got = painted(layer(kind="region", lines=[square], width=-0.05))
    away = np.abs(UV - 0.5).max(axis=1) - 0.3  # from the edge, below 0 inside
    straight = (np.abs(UV - 0.5) < 0.3).any(axis=1)  # off its corners
    assert (got[away < -0.05 - 1e-9] == 0).all() and (got[away > 0.08] == 1).all()
    np.testing.assert_allclose(got[straight & np.isclose(away, 0.0)], 0.5, atol=1e-6)


def test_spots_are_round():
    got = painted(layer(kind="spots", lines=[[[0.5, 0.5]]], width=0.2))
    r = np.linalg.norm(UV - 0.5, axis=1)
    assert (got[r < 0.2] == 0).all() and (got[r > 0.3 + 1e-9] == 1).all()


def test_layers_lie_on_each_other_and_other_parts_get_none():
    white = layer(kind="all", attribute="albedo", value=[1, 1, 1])
    two = [white, layer(kind="all", attribute="albedo", value=[0, 0, 1], amount=0.5)]
    np.testing.assert_allclose(paint_part(two, "face", UV, "")["albedo"], np.tile([0.5, 0.5, 1], (len(UV), 1)))
    assert paint_part(two, "back", UV, "") == {}
    own = {"albedo", "occlusion", "occlusion_floor", "gloss", "lips", "fold", "iris", "sclera", "iris_radius"}
    assert set(BASE) == own


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"kind": "splash", "lines": [[[0, 0]]]}, "kind: 'splash' is not one of all, band, region, spots"),
        ({"kind": ["all"]}, "kind: "), ({"kind": "band"}, "lines: must be a list"), ({}, "kind: missing"),
        ({"kind": "all", "attribute": "shine"}, "attribute: 'shine' is not one of albedo"),
        ({"kind": "all", "attribute": []}, "attribute: "), ({"kind": "all", "value": {}}, "value: must be numbers"),
        ({"kind": "all", "value": [1, 2, 3]}, "value: must have 1 numbers"),
        ({"kind": "all", "value": [float("nan")]}, r"value\[0\]: must be finite"),
        ({"kind": "all", "amount": [1]}, "amount: must be one number"),
        ({"kind": "band", "lines": [[["x", 0]]]}, r"lines\[0\]"), ({"kind": "band", "lines": [[]]}, r"lines\[0\]"),
        ({"kind": "band", "lines": [[[0, 0]]], "feather": "x"}, "feather: must be numbers"),
    ],
)  # fmt: skip
def test_a_wrong_layer_is_named_with_its_key(wrong, message):
    with pytest.raises(HeadFileError, match=rf"head\.toml: paint\[1\]: {message}"):
        paint_part([layer(kind="all"), layer(**wrong)], "face", UV, "head.toml")


@pytest.mark.parametrize("strange", [0.5, "face", ["face"], None])
def test_a_layer_that_is_no_table_is_named(strange):
    with pytest.raises(HeadFileError, match=r"paint\[0\]: must be a table"):
        paint_part([strange], "face", UV, "head.toml")
