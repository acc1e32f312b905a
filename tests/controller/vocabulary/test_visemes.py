"""The table of visemes."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.base.paths import config_dir
from controller.vocabulary.visemes import Visemes

VISEMES = Visemes.load(P)
WIRE_ORDER = ("sil", "PP", "FF", "TH", "DD", "kk", "CH", "SS", "nn", "RR", "aa", "E", "I", "O", "U")


def test_fifteen_in_wire_order() -> None:
    assert VISEMES.names == WIRE_ORDER
    assert VISEMES.matrix.shape == (59, 15)
    assert not VISEMES.matrix[:, 0].any() and VISEMES.matrix[:, 1:].any(axis=0).all()


def test_only_mouth_jaw_and_tongue_move() -> None:
    moved = {P.regions[i] for i in np.flatnonzero(VISEMES.matrix.any(axis=1))}
    assert moved == {"mouth", "jaw", "tongue"}


def test_lips_meet_for_p_and_open_for_a() -> None:
    jaw = P.index("jawOpen")
    assert VISEMES.matrix[jaw, WIRE_ORDER.index("PP")] == 0.0
    assert VISEMES.matrix[jaw].argmax() == WIRE_ORDER.index("aa")
    assert VISEMES.hold.argmax() == WIRE_ORDER.index("PP")


def test_names_aliases_and_phonemes() -> None:
    for name, column in (("PP", "PP"), ("oh", "O"), ("AA1", "aa"), ("b", "PP"), ("SIL", "sil")):
        np.testing.assert_array_equal(VISEMES.weights(name), np.eye(15)[WIRE_ORDER.index(column)])
    with pytest.raises(ParameterError, match="unknown viseme or phoneme 'QQ'"):
        VISEMES.weights("QQ")


def test_every_rhubarb_shape_is_there_and_sums_to_at_most_one() -> None:
    assert set(VISEMES.rhubarb) == set("ABCDEFGHX")
    assert all(0 < mix.sum() <= 1 for mix in VISEMES.rhubarb.values())


def test_a_smile_shows_through() -> None:
    assert 0 < VISEMES.through[P.index("mouthSmileLeft")] < 1
    assert VISEMES.through[P.index("jawOpen")] == 0 and VISEMES.through[P.index("browInnerUp")] == 1
    assert not VISEMES.mask[P.index("browInnerUp")] and VISEMES.mask[P.index("jawOpen")]


def test_speech_may_hold_back_what_no_viseme_moves(tmp_path: Path) -> None:
    path = tmp_path / "visemes.toml"
    shipped = (config_dir() / "vocabularies" / "visemes.toml").read_text()
    path.write_text(shipped.replace("[through]\n", "[through]\nnoseSneer = 0.5\n"))
    assert not VISEMES.mask[P.index("noseSneerLeft")]
    assert Visemes.load(P, path).mask[P.index("noseSneerLeft")]


def test_a_wrong_file_lists_every_fault(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(
        """
        extra = 1
        [visemes.a]
        hold = 2
        loud = 1
        weights = { jawOpn = 0.5, jawOpen = 2 }
        [rhubarb]
        A = { b = 1.0, a = 0.5 }
        [phonemes]
        AA = "c"
        [letters]
        a = "sch tsch"
        [through]
        moth = 0.5
        """
    )
    with pytest.raises(ConfigError) as caught:
        Visemes.load(P, path)
    text = str(caught.value)
    for part in ("extra", "visemes.a.hold", "visemes.a.loud", "visemes.a.weights.jawOpn", "visemes.a.weights.jawOpen",
                 "rhubarb.A: unknown viseme 'b'", "letters.a: 'tsch' has more than 3 letters",
                 "phonemes.AA: unknown viseme 'c'", "through.moth"):  # fmt: skip
        assert part in text
    path.write_text("")
    with pytest.raises(ConfigError, match="visemes: missing"):
        Visemes.load(P, path)


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(Visemes).anything = 1
