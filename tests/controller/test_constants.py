"""Constants of the controller are as large as what they stand for allows: fractions, short waits, published numbers.

What a constant does is tested beside its module; this finds one that was set to nonsense where that is hard to see, as
a share of more than the whole.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
import pytest

from controller.base import clock, linked_clocks, solve
from controller.body import body, main
from controller.cli import app
from controller.face import controls, overlays, point_editing, sculpting, wall
from controller.fleet import batch, follower, node, offset, rejoining, sending, session
from controller.formats.kinds import livelink_format, midi_format
from controller.hardware import bench_many, bench_real_bus, moving, preflight
from controller.layers import gaze, heads
from controller.layers.idle import blinks, gestures, speech
from controller.links.line import commands, host, hostport, link, server
from controller.links.net import conditioning, incoming, meter, midi, neutral, receivers, senders, shown
from controller.links.websocket import messages
from controller.motion import motion
from controller.panels.session import commands as panel_commands
from controller.panels.session import jobs, own_expressions, own_groups, playback
from controller.robot import anchors, busloop, filters, following, formulas, safety
from controller.robot.pairs import files, fit
from controller.stage import inverse, picture, pulling, study
from controller.takes import action_units, azure, edit, line_writer, livelink, timeline
from controller.takes import speech as cues
from controller.takes import voice as take_voice
from controller.tools import bench_bus, monitor, robot_warnings, stage_run, study_run, translate
from controller.vocabulary import expression, facs, reading

SHARES: dict[ModuleType, str] = {
    controls: "_MIN_CHANGE",
    overlays: "_MIN_WEIGHT",
    point_editing: "_MIN_CHANGE",
    sculpting: "_MIN_CARRIED _MIN_SOLVED _MIN_TIED",
    wall: "_ASPECT",
    follower: "_LIMIT_FRACTION _STEP_TOLERANCE_FRACTION",
    bench_many: "MIN_PACED_FRACTION",
    bench_real_bus: "REQUIRED_FRACTION",
    preflight: "MIN_RANGE",
    gaze: "_HEAD_FRACTION",
    heads: "_SPEAKING_LOUDNESS",
    gestures: "_OTHER_SIDE _MAX_UNEVENNESS _MIN_AMOUNT",
    speech: "_MIN_LOUDEST _REARM_FRACTION",
    conditioning: "_MIN_MOVEMENT",
    meter: "_NEW_WEIGHT",
    neutral: "_STILL_TOLERANCE _MIN_RANGE",
    own_expressions: "_MIN_VALUE",
    own_groups: "_MIN_VALUE _MIN_PRODUCT",
    anchors: "_RIDGE _MIN_LIKE_MM _STRAIGHT_MM",
    filters: "_START_SPEED",
    following: "_MAX_ERROR",
    files: "_MAX_BEYOND",
    fit: "_PENALTIES _MIN_SPAN_DEG _MIN_SPAN _CURVE_GAIN _MIN_EXPLAINED _MIN_TERM _ALIKE",
    inverse: "_RIDGE _SPARSITY _TOLERANCE _CONVERGED",
    picture: "_WARMTH_FACTOR",
    pulling: "_STAY_WEIGHT _LIPS_WEIGHT _MIRROR_WEIGHT _DEPTH_WEIGHT _PRIOR_FACTOR _MIN_GAIN _MIN_LOCALITY _OPENING "
    "_CONVERGED _TOLERANCE _MIN_MOVE_MM",
    action_units: "_PRESENT _MIN_CONFIDENCE",
    cues: "_FIRMNESS",
    timeline: "_MIN_CHANGE",
    take_voice: "_SOFT_JAW _LIP_TIME_CONSTANT_S",
    bench_bus: "MIN_WIRE_FRACTIONS",
    robot_warnings: "_BAUD_TOLERANCE",
    facs: "_SPARSITY _MIN_INTENSITY _MIN_COSINE _TOLERANCE",
    reading: "_MIN_LEVEL _RIDGE _SPARSITY",
    solve: "_ZERO",
    safety: "_TOLERANCE_RAD",
    busloop: "_MAX_REST_ERROR_RAD",
    moving: "MAX_LEAD_RAD MAX_END_ERROR_RAD",
}
"""Parts of a whole, and tolerances of which a whole one would be none."""

WAITS: dict[ModuleType, str] = {
    main: "_POLL_S",
    app: "_RETRY_S",
    node: "_POLL_INTERVAL_S",
    host: "_GREETING_INTERVAL_S _POLL_INTERVAL_S",
    link: "_POLL_INTERVAL_S _FAULT_PAUSE_S",
    server: "_WAIT_S _TURN_S _MAX_REST_S",
    incoming: "MIN_READ_INTERVAL_S _WAIT_S",
    midi: "_POLL_INTERVAL_S",
    jobs: "_LOOK_S",
    monitor: "READ_TIMEOUT_S REFRESH_S",
    stage_run: "_POLL_S",
    translate: "_RECEIVE_TIMEOUT_S",
    body: "_MAX_STEP_S",
    motion: "_MAX_STEP_S",
    linked_clocks: "_MAX_DEBT_S",
    playback: "JITTER_S",
    edit: "_MIN_STEP_S",
    azure: "_MIN_MEAN_STEP_S _LAST_VISEME_S",
}
"""Seconds between two looks at something that a person or a servo waits for: not more than a tenth."""

MOMENTS: dict[ModuleType, str] = {
    hostport: "_WRITE_TIMEOUT_S",
    link: "_RETRY_INTERVAL_S",
    receivers: "_RETRY_INTERVAL_S",
    senders: "_RETRY_INTERVAL_S",
    shown: "_RENEW_INTERVAL_S",
    line_writer: "_WRITE_INTERVAL_S",
    follower: "_MIN_TRANSITION_S",
    rejoining: "_SILENT_S _DEAF_S",
    node: "_STATE_INTERVAL_S",
    blinks: "_MIN_GAP_S",
    heads: "_PAUSE_S",
    panel_commands: "_NEUTRAL_S",
    expression: "_TRANSITION_S",
    study: "_RETURN_S",
    study_run: "_SETTLE_S",
    cues: "_ONSET_S _OFFSET_S",
    moving: "STALE_S SETTLE_S",
    preflight: "MAX_LAG_S",
}
"""Seconds that a person notices and does not mind: from a twentieth to nine tenths."""


def _each(table: dict[ModuleType, str]) -> list[tuple[str, Any]]:
    return [(f"{module.__name__}.{name}", getattr(module, name)) for module, names in table.items()
            for name in names.split()]  # fmt: skip


@pytest.mark.parametrize(("name", "value"), _each(SHARES))
def test_a_part_is_less_than_the_whole_and_more_than_nothing(name: str, value: Any) -> None:
    assert (np.asarray(value) > 0.0).all() and (np.asarray(value) < 1.0).all(), name


@pytest.mark.parametrize(("name", "value"), _each(WAITS))
def test_nobody_waits_for_the_next_look(name: str, value: Any) -> None:
    assert 0.0 < value <= 0.1, name


@pytest.mark.parametrize(("name", "value"), _each(MOMENTS))
def test_a_moment_is_shorter_than_a_second(name: str, value: Any) -> None:
    assert 0.05 <= value <= 0.9, name


@pytest.mark.parametrize(
    ("found", "published"),
    [
        ((livelink._FRAMES_PER_S, livelink._DAY_S), (60.0, 24 * 3600)),
        ((livelink_format._VERSION, livelink_format._RATE_HZ, livelink_format._DAY_S), (6, 60, 24 * 3600)),
        ((azure._TICKS_PER_S, azure._RATE_HZ, azure._MAX_FRAMES), (1e7, 60.0, 216_000)),  # an hour
        ((azure._ARKIT_COUNT, azure._SHAPE_COUNT), (52, 55)),
        ((action_units._MAX_INTENSITY, action_units._RATE_HZ), (5.0, 30.0)),
        ((midi_format._CONTROL_CHANGE, midi_format._REAL_TIME, midi_format._EXCLUSIVE), (0xB0, 0xF8, 0xF0)),
        (midi_format._DATA_BYTES, {0x80: 2, 0x90: 2, 0xA0: 2, 0xB0: 2, 0xC0: 1, 0xD0: 1, 0xE0: 2}),
        ((midi_format._MAX_STEP, midi_format._MIDDLE_STEP), (127, 64)),
        ((messages.MAX_RATE_HZ, messages.MIN_RATE_HZ, messages.MAX_WATCH_HZ), (200.0, 0.1, 10.0)),
        ((commands.GAZE_YAW_DEG, commands.GAZE_PITCH_DEG), (95.0, 70.0)),
        ((commands.MIN_RATE_HZ, commands.MIN_DURATION_S, commands.MAX_DURATION_S), (0.1, 0.05, 3600.0)),
        ((commands.MAX_FADE_S, commands.MAX_DISTANCE_MM), (60.0, 1e6)),
        ((formulas.MAX_LENGTH, formulas.MAX_PARTS, formulas.MAX_DEPTH, formulas.MAX_POWER), (600, 200, 24, 8)),
        ((server._AUTH_TIMEOUT_S, server._MAX_WRONG_TOKENS), (10.0, 3)),
        (list(facs._ROTATIONS), list(range(51, 65))),  # of head and eyes
        (receivers._KEEP_ALIVE, {"TCP_KEEPIDLE": 4, "TCP_KEEPINTVL": 2, "TCP_KEEPCNT": 3}),  # ten seconds in all
        ((robot_warnings._CLOCK_HZ,), (3_000_000 * 4,)),
        ((clock._ALIGN_DIVISOR, clock._MAX_ALIGN_DIVISOR), (4, 20)),
        ((batch._MAX_WAIT_NS, node._MARGIN_NS, sending._STATUS_INTERVAL_NS), (2e6, 2e6, 5e7)),
        ((offset._MAX_ANSWERS, offset._MAX_CLOCKS), (16, 16)),
        (session._RETRY, {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2}),
    ],
)
def test_numbers_that_others_count_on_are_theirs(found: Any, published: Any) -> None:
    assert found == published


def test_the_speed_of_a_minimum_jerk_curve_is_its_published_one() -> None:
    """Its peak is 15/8 of the mean, and that of its acceleration 10/sqrt(3) of size by squared time."""
    assert follower._PEAK_SPEED == 15 / 8
    assert pytest.approx(10 / np.sqrt(3), abs=1e-4) == follower._PEAK_ACCELERATION
