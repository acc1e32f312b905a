"""Layers and who holds what."""

from __future__ import annotations

import math
import tracemalloc
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from controller.base.errors import ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.layers.mixer import LayerSettings, Mixer
from controller.layers.settings import default_layers

JAW, SMILE, BROW = P.index("jawOpen"), P.index("mouthSmileLeft"), P.index("browInnerUp")


def mix(mixer: Mixer, now_s: float = 0.0, dt: float = 0.01) -> np.ndarray:
    return mixer.mix(now_s, dt, np.empty(len(P)))


def test_default_layers_are_in_order() -> None:
    assert Mixer(P, default_layers()).names == ("expression", "idle", "gaze", "speech", "capture", "manual")


def test_the_higher_layer_wins_parameter_by_parameter() -> None:
    mixer = Mixer(P, [LayerSettings("top", 2), LayerSettings("base", 1)])
    mixer["base"].write([JAW, SMILE], [0.2, 0.3], 0.0)
    mixer["top"].write([JAW], 0.9, 0.0)
    out = mix(mixer)
    assert out[[JAW, SMILE, BROW]] == pytest.approx([0.9, 0.3, 0.0])
    assert (mixer.holder(JAW), mixer.holder(SMILE), mixer.holder(BROW)) == ("top", "base", None)


def test_weight_set_add_and_max() -> None:
    mixer = Mixer(P, [LayerSettings("base", 1), LayerSettings("half", 2, weight=0.5), LayerSettings("add", 3, "add"),
                      LayerSettings("max", 4, "max")])  # fmt: skip
    mixer["base"].write(slice(None), np.full(59, 0.2), 0.0)
    mixer["half"].write([JAW], [0.8], 0.0)
    mixer["add"].write([JAW, SMILE], [0.1, 0.1], 0.0)
    mixer["max"].write([SMILE, BROW], [0.25, 0.6], 0.0)
    out = mix(mixer)
    assert out[[JAW, SMILE, BROW]] == pytest.approx([0.6, 0.3, 0.6])
    assert [mixer.holder(i) for i in (JAW, SMILE, BROW)] == ["half", "base", "max"]


def test_an_adding_layer_alone_is_the_holder() -> None:
    mixer = Mixer(P, [LayerSettings("idle", 1, "add")])
    mixer["idle"].write([JAW], [0.1], 0.0)
    mix(mixer)
    assert mixer.holder(JAW) == "idle"


def test_latest_value_and_order_of_writing_does_not_matter() -> None:
    mixer = Mixer(P, default_layers())
    for value in (0.1, 0.9, 0.4):
        mixer["manual"].write([JAW], [value], 0.0)
    mixer["expression"].write([JAW], [1.0], 0.0)
    assert mix(mixer)[JAW] == 0.4


def test_fade_in_and_out() -> None:
    mixer = Mixer(P, [LayerSettings("a", 1, fade_in_s=0.2, fade_out_s=0.4)])
    mixer["a"].write([JAW], [1.0], 0.0)
    up = [mix(mixer, 0.1 * i, 0.1)[JAW] for i in range(3)]
    assert up == pytest.approx([0.5, 1.0, 1.0])
    mixer["a"].release([JAW])
    down = [mix(mixer, 0.1 * i, 0.1)[JAW] for i in range(3, 8)]
    assert down == pytest.approx([0.75, 0.5, 0.25, 0.0, 0.0])
    assert mixer.holder(JAW) is None


def test_release_with_its_own_fade() -> None:
    mixer = Mixer(P, [LayerSettings("a", 1, fade_out_s=0.4)])
    mixer["a"].write([JAW], [1.0], 0.0)
    mix(mixer)
    mixer["a"].release(fade_s=0.0)
    assert mix(mixer)[JAW] == 0.0


def test_silence_releases_to_the_layer_below_each_parameter_for_itself() -> None:
    mixer = Mixer(P, [LayerSettings("base", 1), LayerSettings("live", 2, timeout_s=1.0, fade_out_s=0.0)])
    mixer["base"].write(slice(None), np.full(59, 0.1), 0.0)
    mixer["live"].write([JAW, SMILE], [0.9, 0.8], 0.0)
    mixer["live"].write([JAW], [0.7], 0.5)
    assert mix(mixer, 0.9)[[JAW, SMILE]] == pytest.approx([0.7, 0.8])
    assert mix(mixer, 1.2)[[JAW, SMILE]] == pytest.approx([0.7, 0.1])
    assert mix(mixer, 1.6)[[JAW, SMILE]] == pytest.approx([0.1, 0.1])
    assert mixer["live"].holding == 0


def test_what_is_not_finite_changes_nothing() -> None:
    mixer = Mixer(P, default_layers())
    mixer["manual"].write([JAW, SMILE], [0.5, 0.5], 0.0)
    mixer["manual"].write([JAW, SMILE, BROW], [math.nan, 0.6, math.inf], 0.0)
    assert mix(mixer)[[JAW, SMILE, BROW]] == pytest.approx([0.5, 0.6, 0.0])
    mixer["capture"].write_masked(np.full(59, math.nan), np.ones(59, dtype=bool), 0.0)
    assert np.isfinite(mix(mixer)).all()


def test_masked_write_releases_the_rest() -> None:
    mixer = Mixer(P, [LayerSettings("live", 1, fade_out_s=0.0)])
    mixer["live"].write([SMILE], [0.5], 0.0)
    mask = np.zeros(59, dtype=bool)
    mask[JAW] = True
    mixer["live"].write_masked(np.full(59, 0.3), mask, 0.0)
    assert mix(mixer)[[JAW, SMILE]] == pytest.approx([0.3, 0.0])


def test_gain_and_share() -> None:
    mixer = Mixer(P, [LayerSettings("base", 1), LayerSettings("live", 2)])
    mixer["base"].write(slice(None), np.full(59, 0.5), 0.0)
    mixer["live"].write([JAW, SMILE], [0.5, 1.0], 0.0)
    mixer["live"].gain[P.region("jaw")] = 0.4
    mixer["live"].share[SMILE] = 0.0
    assert mix(mixer)[[JAW, SMILE]] == pytest.approx([0.2, 0.5])
    assert mixer.holder(SMILE) == "base"


def test_mixing_does_not_allocate() -> None:
    mixer = Mixer(P, default_layers())
    for name in mixer.names:
        mixer[name].write(slice(None), np.full(59, 0.5), 0.0)
    out = np.empty(59)
    for i in range(50):
        mixer.mix(i * 0.001, 0.001, out)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for i in range(500):
        mixer.mix(0.05 + i * 0.001, 0.001, out)
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert grown < 2048


def test_wrong_layers_are_refused() -> None:
    with pytest.raises(ValueError, match="different names"):
        Mixer(P, [*default_layers(), LayerSettings("gaze", 99)])
    with pytest.raises(KeyError, match="did you mean 'manual'"):
        Mixer(P, default_layers())["manuel"]


def test_a_layer_held_back_mixes_less_of_it() -> None:
    mixer = Mixer(P, [LayerSettings("base", 1), LayerSettings("top", 2)])
    mixer["base"].write([JAW], [0.2], 0.0)
    mixer["top"].write([JAW], [1.0], 0.0)
    for amount, shown in ((0.25, 0.8), (1.0, 0.2), (0.0, 1.0)):
        mixer["top"].attenuate(amount)
        assert mix(mixer)[JAW] == pytest.approx(shown)


def test_a_fade_in_is_as_long_as_it_says_whatever_the_step() -> None:
    mixer = Mixer(P, [LayerSettings("a", 1, fade_in_s=0.4, fade_out_s=0.2)])
    mixer["a"].write([JAW], 1.0, 0.0)
    assert [mix(mixer, 0.0, 0.1)[JAW] for _ in range(5)] == pytest.approx([0.25, 0.5, 0.75, 1.0, 1.0])
    mixer["a"].release([JAW])
    assert [mix(mixer, 0.0, 0.05)[JAW] for _ in range(5)] == pytest.approx([0.75, 0.5, 0.25, 0.0, 0.0])


def test_writing_all_by_a_slice_and_one_value() -> None:
    mixer = Mixer(P, [LayerSettings("a", 1)])
    mixer["a"].write(slice(3, 6), 0.5, 0.0)
    assert np.flatnonzero(mix(mixer)).tolist() == [3, 4, 5] and mixer["a"].holding == 3
    assert mixer.active == ("a",)
    mixer["a"].release(fade_s=0.0)
    mix(mixer)
    assert mixer.active == () and mixer["a"].holding == 0


def test_gains_of_a_layer_scale_its_regions() -> None:
    mixer = Mixer(P, [LayerSettings("a", 1, gains={"jaw": 0.5, "brows": 2.0})])
    mixer["a"].write([JAW, SMILE, BROW], [0.4, 0.4, 0.4], 0.0)
    assert mix(mixer)[[JAW, SMILE, BROW]] == pytest.approx([0.2, 0.4, 0.8])
    with pytest.raises(ParameterError, match="did you mean 'brows'"):
        Mixer(P, [LayerSettings("a", 1, gains={"brow": 1.0})])


def test_an_adding_layer_does_not_hide_the_holder_below() -> None:
    mixer = Mixer(P, [LayerSettings("base", 1), LayerSettings("low", 2, "add"), LayerSettings("high", 3, "add")])
    for name in ("low", "high"):
        mixer[name].write([JAW, SMILE], [0.1, 0.1], 0.0)
    mixer["base"].write([JAW], [0.1], 0.0)
    mix(mixer)
    assert (mixer.holder(JAW), mixer.holder(SMILE), mixer.holder(BROW)) == ("base", "high", None)


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(LayerSettings).anything = 1
