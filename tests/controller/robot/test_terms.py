"""Terms of mixes: weights, input ranges, curves, and what joins them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.robot.channels import ChannelTable, build_table
from controller.robot.following import Mirror
from controller.robot.robot import load_robot
from controller.robot.terms import curve_corners

ROBOT = """
name = "r"
buses = [{ name = "b", kind = "simulated" }]
[[channels]]
name = "c"
bus = "b"
id = 1
model = "xl330-m288"
mix = { %s }
join = "%s"
map = { at = [-10, 10], deg = [-100, 100] }
limit_deg = [-100, 100]
max_speed_deg_s = 300
max_accel_deg_s2 = 3000
"""


def table_of(tmp_path: Path, mix: str, join: str = "sum") -> ChannelTable:
    path = tmp_path / "robot.toml"
    path.write_text(ROBOT % (mix, join))
    return build_table(load_robot(path, P).channels, P)


def mixed(table: ChannelTable, **values: float) -> float:
    face = P.neutral()
    for name, value in values.items():
        face[P.index(name)] = value
    return float(table.mixed(face)[0])


def test_a_term_is_kept_inside_its_range(tmp_path: Path) -> None:
    table = table_of(tmp_path, "jawOpen = { by = 2, in = [0.2, 0.5] }, mouthSmileLeft = 1")
    found = [mixed(table, jawOpen=x) for x in (0.0, 0.3, 0.9)]
    assert found == pytest.approx([0.4, 0.6, 1.0])
    assert mixed(table, jawOpen=0.9, mouthSmileLeft=0.25) == pytest.approx(1.25)


def test_a_term_goes_through_its_points(tmp_path: Path) -> None:
    table = table_of(tmp_path, "headYaw = { at = [-1, 0, 0.5], gives = [3, 0, 1] }")
    assert [mixed(table, headYaw=x) for x in (-1, -0.5, 0, 0.25, 0.5, 1)] == pytest.approx([3, 1.5, 0, 0.5, 1, 1])


@pytest.mark.parametrize(("join", "wanted"), [("sum", 0.9), ("min", 0.2), ("max", 0.7)])
def test_terms_join_as_the_channel_says(tmp_path: Path, join: str, wanted: float) -> None:
    table = table_of(tmp_path, "jawOpen = 1, mouthFunnel = { by = 0.5, in = [0, 1] }", join)
    assert mixed(table, jawOpen=0.7, mouthFunnel=0.4) == pytest.approx(wanted)


def test_the_mirror_reads_a_channel_of_terms(tmp_path: Path) -> None:
    table = table_of(tmp_path, "jawOpen = { by = 2, in = [0, 1] }")
    face = P.neutral()
    face[P.index("jawOpen")] = 0.6
    assert Mirror(table, P).read(table.angles(face)[0])[P.index("jawOpen")] == pytest.approx(0.6, abs=0.01)


@settings(deadline=None)  # the first call imports scipy
@given(st.lists(st.floats(-5, 5), min_size=3, max_size=6), st.integers(0, 2**32 - 1))
def test_a_smooth_curve_meets_its_points_and_overshoots_nowhere(gives: list[float], seed: int) -> None:
    at = np.cumsum(np.random.default_rng(seed).uniform(0.1, 1.0, len(gives)))
    corners, values = curve_corners(at, np.array(gives), "smooth")
    assert np.interp(at, corners, values) == pytest.approx(gives)
    for i in range(len(at) - 1):
        inside = values[(corners >= at[i]) & (corners <= at[i + 1])]
        low, high = sorted(gives[i : i + 2])
        assert inside.min() >= low - 1e-9 and inside.max() <= high + 1e-9


def test_a_smooth_curve_is_smoother_than_a_straight_one() -> None:
    at = np.linspace(0, np.pi / 2, 5)
    x = np.linspace(0, np.pi / 2, 200)
    worst = {
        c: np.abs(np.interp(x, *curve_corners(at, np.sin(at), c)) - np.sin(x)).max() for c in ("straight", "smooth")
    }
    assert worst["smooth"] < 0.5 * worst["straight"]


@pytest.mark.parametrize(
    ("mix", "fault"),
    [
        ("jawOpen = true", "channels[0].mix.jawOpen: must be a number, or a table"),
        ("jawOpen = nan", "channels[0].mix.jawOpen.by: "),
        ("jawOpen = { in = [1, 0] }", "channels[0].mix.jawOpen: in must be [lowest, highest]"),
        ("jawOpen = { at = [0, 1] }", "channels[0].mix.jawOpen: at and gives go together"),
        ("jawOpen = { at = [0, 0], gives = [0, 1] }", "channels[0].mix.jawOpen: at must rise"),
        ("jawOpen = { at = [0, 1], gives = [0] }", "channels[0].mix.jawOpen: at and gives need the same number"),
        ("jawOpen = { at = [0, 1], gives = [0, 1], by = 2 }", "at and gives take the place of by and in"),
        ("jawOpen = { within = [0, 1], inn = 2 }", "channels[0].mix.jawOpen.inn: unknown key"),
        ("", "channels[0]: needs either mix or anchor"),
    ],
)
def test_a_faulty_term_is_named_with_its_key(tmp_path: Path, mix: str, fault: str) -> None:
    with pytest.raises(ConfigError) as caught:
        table_of(tmp_path, mix)
    assert fault in str(caught.value)
