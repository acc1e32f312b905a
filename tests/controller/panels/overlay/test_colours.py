"""controller.panels.overlay.colours, and the colours of families of control points."""

from __future__ import annotations

from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from controller.panels.overlay import colours
from controller.panels.overlay.colours import AMBER, BRIGHT_GREEN, GREEN, GREY, LAYERS, OTHER, RED, layer_colour, packed
from controller.panels.overlay.overlay_view import _FAMILY_COLOURS

OPAQUE = {name: each for name, each in vars(colours).items() if name.isupper() and name != "LAYERS"} | LAYERS


@pytest.mark.parametrize("name", OPAQUE)
def test_a_colour_has_shares_of_light_and_hides_what_is_behind_it(name: str) -> None:
    assert len(OPAQUE[name]) == 4 and all(0.0 <= share <= 1.0 for share in OPAQUE[name])
    assert OPAQUE[name][3] == 1.0


def test_colours_are_what_their_names_say() -> None:
    assert max(RED[1:3]) < RED[0] / 2
    assert GREEN[1] > 2 * max(GREEN[0], GREEN[2])
    assert BRIGHT_GREEN[1] == max(BRIGHT_GREEN[:3]) > GREEN[1] + 0.2
    assert AMBER[0] > AMBER[1] > AMBER[2] + 0.3
    assert len(set(GREY[:3])) == len(set(OTHER[:3])) == 1


def test_no_two_layers_look_alike_and_others_share_one_colour() -> None:
    assert all(np.abs(np.subtract(one, two)).max() >= 0.1 for one, two in combinations([*LAYERS.values(), OTHER], 2))
    assert layer_colour("gaze") == LAYERS["gaze"] and layer_colour("mine") == OTHER


def test_families_are_told_apart_and_the_first_colour_is_grey() -> None:
    assert _FAMILY_COLOURS.shape[1] == 3 and ((_FAMILY_COLOURS >= 0.0) & (_FAMILY_COLOURS <= 1.0)).all()
    assert np.ptp(_FAMILY_COLOURS[0]) == 0.0  # of control points that no group moves
    assert all(np.abs(one - two).max() >= 0.1 for one, two in combinations(_FAMILY_COLOURS, 2))


@pytest.mark.parametrize(("given", "alpha"), [((), 0.5), ((0.5,), 0.25)])
def test_a_colour_is_packed_with_the_share_that_is_asked_for(given: tuple[float, ...], alpha: float) -> None:
    seen = []
    imgui = SimpleNamespace(ImVec4=lambda *rgba: rgba, color_convert_float4_to_u32=lambda rgba: seen.append(rgba) or 7)
    assert packed(imgui, (0.1, 0.2, 0.3, 0.5), *given) == 7
    assert seen == [(0.1, 0.2, 0.3, alpha)]
