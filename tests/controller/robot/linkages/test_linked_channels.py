"""Channels of a linkage: which parameters their inputs follow, and what becomes of them where it does not reach."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from controller.base.errors import ParameterError
from controller.base.parameters import PARAMETERS as P
from controller.robot.linkages.kind import read_linkage
from controller.robot.linkages.linked_channels import LinkedChannels, input_names
from tests.controller.robot.necks import face


def gimbal(**inputs: Any) -> Any:
    """Two servos whose angles are the inputs themselves: yaw outside."""
    table = {"name": "eye", "kind": "gimbal", "channels": ["pan", "tilt"], "outer": "yaw", "inputs": inputs}
    return read_linkage(table)


def linked(**inputs: Any) -> LinkedChannels:
    return LinkedChannels.of(gimbal(**inputs), ["jaw", "tilt", "lid", "pan"], P)


def test_channels_have_their_places_on_the_bus_in_the_order_of_the_geometry() -> None:
    made = linked(yaw="headYaw", pitch="headPitch")
    assert made.name == "eye" and made.at.tolist() == [3, 1]


def test_inputs_follow_formulas_or_terms_that_are_added() -> None:
    made = linked(
        yaw="10 * headYaw + 5 * jawOpen",
        pitch={"leftEyePitch": 20, "eyeBlinkLeft": {"by": -8, "in": [0.25, 0.75]},
               "jawOpen": {"at": [0, 0.5, 1], "gives": [1, 4, -3]}},
    )  # fmt: skip
    needs = P.indices(["headYaw", "jawOpen", "leftEyePitch", "eyeBlinkLeft"])
    assert made.needs.tolist() == sorted(needs)
    for blink, kept in ((0.0, 0.25), (0.5, 0.5), (1.0, 0.75)):
        found = made(face(headYaw=0.5, jawOpen=0.25, leftEyePitch=-0.5, eyeBlinkLeft=blink))
        assert found == pytest.approx([10 * 0.5 + 5 * 0.25, 20 * -0.5 - 8 * kept + 2.5])


def test_a_face_without_a_needed_value_gives_no_angle_and_counts_as_nothing() -> None:
    made = linked(yaw="30 * headYaw", pitch="headPitch")
    values = face(headYaw=0.5)
    values[P.index("headPitch")] = np.nan
    assert np.isnan(made(values)).all() and made(values).shape == (2,)
    assert not made.outside and made.times == 0
    values[P.index("headPitch")], values[P.index("jawOpen")] = 0.0, np.nan  # nobody follows the jaw
    assert made(values) == pytest.approx([15.0, 0.0])


def test_how_often_inputs_became_unreachable_is_counted() -> None:
    made = linked(yaw="100 * headYaw", pitch="headPitch")
    for yaw, outside, times in ((0.5, False, 0), (0.9, True, 1), (1.0, True, 1), (0.1, False, 1), (-0.9, True, 2)):
        made(face(headYaw=yaw))
        assert (made.outside, made.times) == (outside, times), yaw


def test_names_of_inputs_are_those_of_the_robot_file() -> None:
    settings = gimbal(yaw="headYaw - jawOpen", pitch={"headPitch": 2, "leftEyePitch": 1})
    assert sorted(input_names(settings)) == [
        ("inputs.pitch", "headPitch"), ("inputs.pitch", "leftEyePitch"), ("inputs.yaw", "headYaw"),
        ("inputs.yaw", "jawOpen"),
    ]  # fmt: skip


def test_an_unknown_parameter_is_named() -> None:
    with pytest.raises(ParameterError, match="headYow"):
        linked(yaw="headYow", pitch="headPitch")
