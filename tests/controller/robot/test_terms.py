"""Terms of mixes: weights, input ranges, curves, and what joins them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS as P
from controller.robot.channels import ChannelTable, build_table
from controller.robot.following import Mirror
from controller.robot.robot import load_robot
from controller.robot.terms import TermSettings, curve_corners, monotone_slopes

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
        ("", "channels[0]: 'c' needs one of mix, formula and anchor, or a linkage"),
    ],
)
def test_a_faulty_term_is_named_with_its_key(tmp_path: Path, mix: str, fault: str) -> None:
    with pytest.raises(ConfigError) as caught:
        table_of(tmp_path, mix)
    assert fault in str(caught.value)


def test_terms_are_described_for_people() -> None:
    plain, kept = TermSettings(by=-0.4), TermSettings.model_validate({"by": 2, "in": [0.25, 1]})
    assert kept == TermSettings(by=2, within=(0.25, 1))
    curve = TermSettings(at=[0, 0.5, 1], gives=[0, 0, 1])
    found = [term.describe("jawOpen") for term in (plain, kept, curve)]
    assert found == ["-0.4 jawOpen", "+2 jawOpen in 0.25..1", "+jawOpen through 3 points"]
    assert [term.is_weight for term in (plain, kept, curve)] == [True, False, False]


def test_a_smooth_curve_is_the_monotone_cubic_through_its_points() -> None:
    """By hand (Fritsch and Butland 1984): slopes 0.75, 0 and 1 for points that rise by 1 and rest, then rise by 1."""
    x, y = curve_corners(np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 1.0, 1.0, 2.0]), "smooth")
    assert len(x) == 3 * 8 + 1 and x[1] == pytest.approx(1 / 8) and (x[-1], y[-1]) == (3.0, 2.0)
    assert y[(x > 1.0) & (x < 2.0)] == pytest.approx(1.0)
    t = 0.5
    hermite = t * (1 - t) ** 2 * 1.5 + t**2 * (3 - 2 * t)  # the end's slope, three points long, is 1.5
    assert np.interp(0.5, x, y) == pytest.approx(hermite)
    two = curve_corners(np.array([0.0, 1.0]), np.array([0.0, 1.0]), "smooth")
    assert two[0].tolist() == [0.0, 1.0]


@pytest.mark.parametrize("seed", range(20))
def test_the_slopes_of_a_smooth_curve_are_scipys(seed: int) -> None:
    random = np.random.default_rng(seed)
    at = np.cumsum(random.uniform(0.1, 2.0, 3 + seed % 5))
    gives = random.choice([-1.0, 0.0, 0.0, 0.3, 2.0], len(at))
    wanted = PchipInterpolator(at, gives)
    assert np.allclose(monotone_slopes(at, gives), wanted.derivative()(at), rtol=0, atol=1e-12)
    x, y = curve_corners(at, gives, "smooth")
    assert np.allclose(y, wanted(x), rtol=0, atol=1e-12)
