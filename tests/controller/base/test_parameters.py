"""The registry of parameters."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import PARAMETERS, REGIONS, Parameters, did_you_mean, fold

UDP_ORDER = """
eyeBlinkLeft eyeLookDownLeft eyeLookInLeft eyeLookOutLeft eyeLookUpLeft eyeSquintLeft eyeWideLeft
eyeBlinkRight eyeLookDownRight eyeLookInRight eyeLookOutRight eyeLookUpRight eyeSquintRight eyeWideRight
jawForward jawLeft jawRight jawOpen mouthClose mouthFunnel mouthPucker mouthLeft mouthRight
mouthSmileLeft mouthSmileRight mouthFrownLeft mouthFrownRight mouthDimpleLeft mouthDimpleRight
mouthStretchLeft mouthStretchRight mouthRollLower mouthRollUpper mouthShrugLower mouthShrugUpper
mouthPressLeft mouthPressRight mouthLowerDownLeft mouthLowerDownRight mouthUpperUpLeft mouthUpperUpRight
browDownLeft browDownRight browInnerUp browOuterUpLeft browOuterUpRight
cheekPuff cheekSquintLeft cheekSquintRight noseSneerLeft noseSneerRight tongueOut
headYaw headPitch headRoll leftEyeYaw leftEyePitch rightEyeYaw rightEyePitch
"""


def test_names_are_arkit_in_live_link_order_then_angles() -> None:
    assert list(PARAMETERS.names) == UDP_ORDER.split()


def test_ranges_and_full_scales() -> None:
    angles = slice(52, 59)
    assert np.all(PARAMETERS.low[:52] == 0) and np.all(PARAMETERS.low[angles] == -1)
    assert np.all(PARAMETERS.high == 1)
    np.testing.assert_allclose(np.degrees(PARAMETERS.full_scale_rad[angles]), [60, 40, 30, 35, 30, 35, 30])
    assert np.all(np.isnan(PARAMETERS.full_scale_rad[:52]))


def test_every_region_has_parameters_and_none_is_left_out() -> None:
    found = np.concatenate([PARAMETERS.region(region) for region in REGIONS])
    assert sorted(found) == list(range(59))


def test_lids_are_faster_than_brows() -> None:
    lid, brow = PARAMETERS.index("eyeBlinkLeft"), PARAMETERS.index("browDownLeft")
    assert PARAMETERS.max_speed[lid] > PARAMETERS.max_speed[brow]
    assert PARAMETERS.max_acceleration[lid] > PARAMETERS.max_acceleration[brow]


@pytest.mark.parametrize(
    ("spelling", "name"),
    [
        ("EyeBlinkLeft", "eyeBlinkLeft"),
        ("eyeBlink_L", "eyeBlinkLeft"),
        ("eyeblink_r", "eyeBlinkRight"),
        ("MOUTHSMILELEFT", "mouthSmileLeft"),
        ("HeadYaw", "headYaw"),
        ("head_yaw", "headYaw"),
        ("eyeYawRight", "rightEyeYaw"),
        ("EyePitch_L", "leftEyePitch"),
    ],
)
def test_other_spellings(spelling: str, name: str) -> None:
    assert PARAMETERS.index(spelling) == PARAMETERS.names.index(name)


def test_every_name_is_found_in_pascal_case_and_with_suffix() -> None:
    for i, name in enumerate(PARAMETERS.names):
        assert PARAMETERS.index(name[0].upper() + name[1:]) == i
        short = name.removesuffix("Left") + "_L" if name.endswith("Left") else name
        assert PARAMETERS.index(short) == i


def test_unknown_name_suggests_the_nearest() -> None:
    with pytest.raises(ParameterError, match=r"unknown parameter 'jawOpn', did you mean 'jawOpen'\?") as caught:
        PARAMETERS.index("jawOpn")
    assert "LIST PARAMETERS" in caught.value.hint
    with pytest.raises(ParameterError, match=r"^unknown parameter 'qqqq'$"):
        PARAMETERS.index("qqqq")
    with pytest.raises(ParameterError, match="did you mean 'mouth'"):
        PARAMETERS.region("mouht")


def test_clip_keeps_the_last_good_value() -> None:
    out = np.full(59, 0.25)
    values = np.linspace(-2, 2, 59)
    values[[0, 1, 2]] = [math.nan, math.inf, -math.inf]
    assert PARAMETERS.clip(values, out) is out
    assert list(out[:3]) == [0.25] * 3
    np.testing.assert_array_equal(out[3:], np.clip(values, PARAMETERS.low, PARAMETERS.high)[3:])


def test_mirror_swaps_sides_and_undoes_itself() -> None:
    mirror = PARAMETERS.mirror()
    pairs = [("eyeBlinkLeft", "eyeBlinkRight"), ("jawLeft", "jawRight"), ("leftEyeYaw", "rightEyeYaw")]
    for left, right in [*pairs, ("jawOpen", "jawOpen")]:
        assert mirror[PARAMETERS.index(left)] == PARAMETERS.index(right)
    np.testing.assert_array_equal(mirror[mirror], np.arange(59))


def test_arrays_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        PARAMETERS.low[0] = 5
    assert not PARAMETERS.neutral().any()


def test_fold_and_guess() -> None:
    assert fold(" Eye_Blink-L ") == "eyeblinkleft"
    assert did_you_mean("mouthSmileLft", PARAMETERS.names).startswith(", did you mean 'mouthSmileLeft'")


def test_a_wrong_file_lists_every_fault(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(
        """
        colour = 1
        [profile.a]
        range = [0.0, 1.0]
        max_speed = 1.0
        max_acceleration = 1.0
        response_s = 0.1
        [parameters]
        good = { region = "mouth", profile = "a" }
        wide = { region = "mouth", profile = "a", range = [1.0, 0.0] }
        else_ = { region = "jav", profile = "a" }
        slow = { region = "mouth", profile = "a", max_speed = 0.0, sped = 3 }
        lost = { region = "mouth", profile = "b" }
        bare = 3
        [aliases]
        other = "god"
        """
    )
    with pytest.raises(ConfigError) as caught:
        Parameters.load(path)
    text = str(caught.value)
    for part in (
        str(path), "8 faults", "colour: unknown key", "parameters.wide.range",
            "parameters.else_.region: unknown region 'jav', did you mean 'jaw'",
        "parameters.slow.max_speed", "parameters.slow.sped: unknown key", "parameters.lost: unknown profile 'b'",
        "parameters.bare: must be a table (is 3)", "aliases.other: unknown parameter 'god', did you mean 'good'",
    ):  # fmt: skip
        assert part in text


def test_a_missing_or_broken_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        Parameters.load(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_text("[parameters\n")
    with pytest.raises(ConfigError, match="not valid TOML"):
        Parameters.load(tmp_path / "bad.toml")


FILE = """
[profile.turn]
range = [-1.0, 1.0]
full_scale_deg = 60.0
max_speed_deg_s = 300.0
max_acceleration_deg_s2 = 1500.0
response_s = 0.05
[profile.skin]
range = [0.0, 1.0]
max_speed = 8.0
max_acceleration = 120.0
response_s = 0.03
[parameters]
headYaw = { region = "head", profile = "turn" }
headRoll = { region = "head", profile = "turn", max_jerk_deg_s3 = 6000.0, range = [-0.5, 1] }
smile = { region = "mouth", profile = "skin", max_jerk = 9000, response_s = 1 }
bare = { region = "jaw", range = [0, 2], max_speed = 1, max_acceleration = 2, response_s = 3 }
[aliases]
Grin_L = "smile"
"""


def test_a_file_of_ones_own_in_units_and_degrees(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(FILE)
    p = Parameters.load(path)
    assert p.names == ("headYaw", "headRoll", "smile", "bare") and p.regions == ("head", "head", "mouth", "jaw")
    assert p.low.tolist() == [-1, -0.5, 0, 0] and p.high.tolist() == [1, 1, 1, 2]
    np.testing.assert_allclose(p.max_speed, [5, 5, 8, 1])
    np.testing.assert_allclose(p.max_acceleration, [25, 25, 120, 2])
    np.testing.assert_allclose(p.max_jerk, [math.inf, 100, 9000, math.inf])
    np.testing.assert_allclose(p.response_s, [0.05, 0.05, 1, 3])
    np.testing.assert_allclose(p.full_scale_rad, [math.pi / 3, math.pi / 3, math.nan, math.nan])
    assert p.index("grin-left") == 2 and len(p) == 4
    assert p.region("head").tolist() == [0, 1] and p.region("tongue").tolist() == []
    assert p.indices(["bare", "headYaw"]).tolist() == [3, 0]


@pytest.mark.parametrize(
    ("found", "put", "fault"),
    [
        ("max_speed_deg_s = 300.0", "", "parameters.headYaw.max_speed_deg_s: missing, must be a positive number"),
        ("max_speed = 8.0", "", "parameters.smile.max_speed: missing, must be a positive number"),
        (
            "max_acceleration = 2,",
            "max_acceleration = -2,",
            "bare.max_acceleration: input should be greater",
        ),
        (
            "max_acceleration = 2,",
            "max_acceleration = inf,",
            "bare.max_acceleration: input should be a finite",
        ),
        ("max_speed = 1,", "max_speed = true,", "parameters.bare.max_speed: input should be a valid number (is True)"),
        ("range = [0, 2]", "range = [2, 2]", "parameters.bare.range: must be [lowest, highest], not [2.0, 2.0]"),
        ("range = [0, 2]", "range = [2]", "parameters.bare.range[1]: missing"),
        ('region = "jaw", ', "", "parameters.bare.region: missing"),
        ('profile = "skin"', "profile = [1]", "parameters.smile: unknown profile '[1]'"),
        ('profile = "skin"', 'profile = "skn"', "parameters.smile: unknown profile 'skn', did you mean 'skin'?"),
        ('"smile"\n', '"smle"\n', "aliases.Grin_L: unknown parameter 'smle', did you mean 'smile'?"),
    ],
)
def test_one_fault_is_named_with_its_place(tmp_path: Path, found: str, put: str, fault: str) -> None:
    path = tmp_path / "own.toml"
    assert found in FILE
    path.write_text(FILE.replace(found, put))
    with pytest.raises(ConfigError) as caught:
        Parameters.load(path)
    assert fault in str(caught.value)


def test_a_file_without_parameters_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    for text, fault in (
        ("", "parameters: missing"),
        ("[parameters]\n", "parameters: dictionary should have at least 1"),
    ):
        path.write_text(text)
        with pytest.raises(ConfigError, match=fault):
            Parameters.load(path)


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(Parameters).anything = 1
