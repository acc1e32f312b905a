"""drivers.dynamixel.layout: steps and radians there and back, and blocks that decode as the registers do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import drivers.core.kernels  # noqa: F401  compiled code is loaded here and not within an example's deadline
from drivers.base.bus import ServoSpec
from drivers.core.scale import Scale
from drivers.dynamixel.layout import item_of, layout_of
from drivers.servos.layout import Block, Group
from drivers.tables.tables import load_table

MODELS = ("xl330-m288", "xm430-w350", "xl430-w250", "xl320", "mx-28")


def spec(model: str = "xl330-m288", **changes: object) -> ServoSpec:
    base = {"min_rad": -1.0, "max_rad": 1.0, "max_speed_rad_s": 5.0, "max_accel_rad_s2": 50.0}
    return ServoSpec(id=1, name="jaw", model=model, **{**base, **changes})


def scale(model: str = "xl330-m288", **changes: object) -> Scale:
    return Scale([spec(model, **changes)], [load_table(model)])


models = st.sampled_from(MODELS)
zeros = st.floats(-1.0, 1.0)
settings = {"model": models, "reverse": st.booleans(), "zero": zeros}


@given(**settings, tick=st.integers(0, 4095))
def test_every_step_survives_the_way_there_and_back(model: str, reverse: bool, zero: float, tick: int) -> None:
    tick %= load_table(model).ticks_per_turn
    both = scale(model, reverse=reverse, zero_rad=zero)
    assert both.ticks(both.radians(np.array([tick])))[0] == tick


@given(**settings, angle=st.floats(-1.5, 1.5))
def test_an_angle_is_kept_to_half_a_step(model: str, reverse: bool, zero: float, angle: float) -> None:
    both = scale(model, reverse=reverse, zero_rad=zero)
    back = both.radians(both.ticks(np.array([angle])))[0]
    assert abs(back - angle) <= both.rad_per_tick[0] / 2 + 1e-9


@given(**settings, low=st.floats(-2.0, 1.9), span=st.floats(0.01, 2.0))
def test_step_limits_lie_inside_the_angle_limits(
    model: str, reverse: bool, zero: float, low: float, span: float
) -> None:
    both = scale(model, reverse=reverse, zero_rad=zero, min_rad=low, max_rad=low + span)
    assert 0 <= both.low[0] <= both.high[0] < load_table(model).ticks_per_turn
    if both.low[0] < both.high[0]:
        ends = np.array([both.radians(both.low)[0], both.radians(both.high)[0]])
        assert ends.min() >= low - 1e-6 * both.rad_per_tick[0] - 1e-9 or both.low[0] == 0 or reverse
        assert ends.max() <= low + span + 2e-6 * both.rad_per_tick[0] + 1e-9


def test_the_middle_of_the_range_is_zero_and_angles_grow_with_steps() -> None:
    assert scale().ticks(np.array([0.0]))[0] == 2048
    assert scale().ticks(np.array([np.pi / 2]))[0] == 3072
    assert scale(reverse=True).ticks(np.array([np.pi / 2]))[0] == 1024
    assert scale(zero_rad=np.pi / 2).ticks(np.array([0.0]))[0] == 3072
    assert scale(zero_rad=np.pi / 2, reverse=True).ticks(np.array([np.pi / 2]))[0] == 2048
    assert scale("xl320").ticks(np.array([np.radians(150.0) - 0.001]))[0] == 1024
    assert scale("xl320").radians(np.array([0]))[0] == pytest.approx(np.radians(-150.0))


def test_servos_of_one_bus_keep_their_own_scales() -> None:
    servos = [spec(), spec("xl320", reverse=True)]
    both = Scale(servos, [load_table(servo.model) for servo in servos])
    np.testing.assert_array_equal(both.ticks(np.array([0.5, 0.5])), [2048 + 326, 512 - 98])


def test_registers_of_the_servo_narrow_the_limits() -> None:
    both = scale()
    both.narrow(0, 2000, 2100)
    assert (both.low[0], both.high[0]) == (2000, 2100)
    both.narrow(0, 3000, 3100)
    assert (both.low[0], both.high[0]) == (3000, 3000)


def test_blocks_of_x_series_and_xl320() -> None:
    layout = layout_of(load_table("xl330-m288"))
    assert (layout.feedback.address, layout.feedback.size, layout.goal.address) == (126, 10, 116)
    assert [(block.address, block.size) for block in layout.slow] == [(64, 1), (70, 1), (98, 1), (140, 7)]
    assert (layout_of(load_table("xl330-m288"), "position").feedback.address) == 132
    small = layout_of(load_table("xl320"))
    assert (small.feedback.address, small.feedback.size, small.goal.size) == (37, 6, 2)
    assert [(block.address, block.size) for block in small.slow] == [(24, 1), (50, 1), (45, 2)]
    assert small.key != layout.key
    assert layout.key == layout_of(load_table("xm430-w350")).key


@pytest.mark.parametrize("model", MODELS)
def test_no_block_is_as_long_as_a_pings_reply(model: str) -> None:
    layout = layout_of(load_table(model))
    assert 3 not in [block.size for block in (layout.feedback, *layout.slow)]


@given(st.integers(-(2**15), 2**15 - 1), st.integers(-(2**31), 2**31 - 1), st.integers(-(2**31), 2**31 - 1))
def test_a_block_decodes_as_its_registers_do(current: int, velocity: int, position: int) -> None:
    table = load_table("xl330-m288")
    block: Block = layout_of(table).feedback
    items = [item_of(table, name) for name in ("current", "velocity", "position")]
    data = b"".join(item.encode(v) for item, v in zip(items, (current, velocity, position), strict=True) if item)
    values = block.decode(np.frombuffer(data + data, np.uint8).reshape(2, -1))
    assert [values[name].tolist() for name in ("current", "velocity", "position")] == [
        [current] * 2,
        [velocity] * 2,
        [position] * 2,
    ]


def test_speeds_with_a_direction_bit() -> None:
    feedback = layout_of(load_table("xl320")).feedback
    words = np.array([[9, 0, 7], [9, 100, 7], [9, 1024 + 100, 7]], "<u2")
    values = feedback.decode(words.view(np.uint8).reshape(3, 6))
    assert values["velocity"].tolist() == [0, 100, -100]
    assert values["position"].tolist() == [9, 9, 9]


def test_a_load_in_per_cent_is_no_current() -> None:
    tables = [load_table("xl430-w250"), load_table("xl330-m288")]
    scales = Group([1, 2], [0, 1], tables, layout_of(tables[0])).scales["current"]
    np.testing.assert_array_equal(scales, [np.nan, 0.001])
