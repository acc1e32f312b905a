"""Takes in the ranges of another person."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.takes.reader import load_take
from controller.takes.retarget import load_ranges, retarget
from controller.tools.check import check_anything
from controller.tools.motion_file import convert

JAW, YAW = P.index("jawOpen"), P.index("headYaw")


@pytest.fixture
def ranges(tmp_path: Path) -> Path:
    path = tmp_path / "me.toml"
    path.write_text("[ranges]\njawOpen = [0.1, 0.6]\nmouthSmile = [0, 0.5]\nheadYaw = [-0.5, 1]\n")
    return path


def test_a_parameter_goes_straight_through_its_range_and_an_angle_stays_at_zero(ranges: Path) -> None:
    low, high = load_ranges(ranges, P)
    values = np.zeros((3, len(P)))
    values[:, JAW], values[:, YAW] = (0.0, 0.5, 1.0), (-1.0, 0.0, 1.0)
    found = retarget(values, low, high, P)
    np.testing.assert_allclose(found[:, JAW], (0.1, 0.35, 0.6))
    np.testing.assert_allclose(found[:, YAW], (-0.5, 0.0, 1.0))


def test_omote_check_knows_such_files(ranges: Path) -> None:
    assert check_anything(str(ranges)) == ["ranges me.toml: of 4 parameters: good"]


def test_what_the_file_does_not_name_stays(ranges: Path) -> None:
    low, high = load_ranges(ranges, P)
    values = np.random.default_rng(1).uniform(P.low, P.high, (20, len(P)))
    same = [i for i, name in enumerate(P.names) if not name.startswith(("jawOpen", "mouthSmile", "headYaw"))]
    np.testing.assert_allclose(retarget(values, low, high, P)[:, same], values[:, same])


def test_parameters_of_ones_own_go_through_ranges_of_their_own(tmp_path: Path) -> None:
    file, ranges = tmp_path / "ears.toml", tmp_path / "me.toml"
    limits = "response_s = 0.1\nmax_speed = 9\nmax_acceleration = 90\n"
    text = "".join(
        f'[parameters.{name}]\nregion = "head"\nrange = {ends}\nrest = {ends[0]}\n{limits}'
        for name, ends in (
            ("earUp", [0.0, 0.5]),
            ("earTurn", [-2.0, 3.0]),
            ("earTilt", [-3.0, -1.0]),
            ("glow", [2.0, 5.0]),
        )
    )
    file.write_text(text)
    own = P.with_files([file])
    at = [own.index(name) for name in ("earUp", "earTurn", "earTilt", "glow")]
    values = np.zeros((3, len(own)))
    values[:, at] = [(0.0, -2.0, -3.0, 2.0), (0.2, -1.0, -2.0, 3.0), (0.5, 3.0, -1.0, 5.0)]
    ranges.write_text("[ranges]\njawOpen = [0, 0.5]\n")
    np.testing.assert_allclose(retarget(values, *load_ranges(ranges, own), own)[:, at], values[:, at])
    ranges.write_text("[ranges]\nearUp = [0, 0.25]\nearTurn = [-1, 1.5]\nearTilt = [-2, -1]\nglow = [2, 3.5]\n")
    wanted = [(0.0, -1.0, -2.0, 2.0), (0.1, -0.5, -1.5, 2.5), (0.25, 1.5, -1.0, 3.5)]
    np.testing.assert_allclose(retarget(values, *load_ranges(ranges, own), own)[:, at], wanted)


def test_omote_convert_takes_ranges(ranges: Path, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time,jawOpen,mouthSmileLeft\n0,0,1\n1,1,0.5\n")
    convert(tmp_path / "a.csv", tmp_path / "b.csv", P, ranges=ranges)
    take = load_take(tmp_path / "b.csv", P)
    assert take.values[:, JAW].tolist() == [0.1, 0.6]
    assert take.values[:, P.index("mouthSmileLeft")].tolist() == [0.5, 0.25]
    assert take.mask.sum() == 2


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "ranges: missing"),
        ("[ranges]\njawOpn = [0, 1]", "ranges.jawOpn: unknown parameter, did you mean 'jawOpen'"),
        ("[ranges]\njawOpen = [0, 2]", "ranges.jawOpen: must lie in the range of the parameter, 0 to 1"),
        ("[ranges]\njawOpen = [-0.5, 1]", "ranges.jawOpen: must lie in the range of the parameter, 0 to 1"),
        ("[ranges]\njawOpen = [0, inf]", "finite"),
        ("[ranges]\nheadYaw = [0.1, 1]", "ranges.headYaw: an angle goes from 0 or less"),
    ],
)
def test_what_is_wrong_is_told(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "me.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_ranges(path, P)
    assert told in str(caught.value)
