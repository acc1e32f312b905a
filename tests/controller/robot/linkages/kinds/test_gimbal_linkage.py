"""A gimbal against scipy's rotations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controller.base.parameters import PARAMETERS as P
from controller.robot.linkages.kind import read_linkage
from controller.robot.linkages.kinds.gimbal_linkage import Gimbal
from controller.robot.linkages.linked_channels import LinkedChannels
from tests.controller.robot.necks import face


@pytest.mark.parametrize("outer", ["yaw", "pitch"])
def test_a_gimbal_looks_where_the_eye_shall_look(outer: str) -> None:
    table = {"name": "eye", "kind": "gimbal", "channels": ["a", "b"], "outer": outer,
             "inputs": {"pitch": {"leftEyePitch": 30}, "yaw": {"leftEyeYaw": 35}}}  # fmt: skip
    linked = LinkedChannels.of(read_linkage(table), ["a", "b"], P)
    order = "YX" if outer == "yaw" else "XY"
    for yaw, pitch in np.random.default_rng(3).uniform(-1, 1, (20, 2)):
        servo_yaw, servo_pitch = linked(face(leftEyeYaw=yaw, leftEyePitch=pitch))
        angles = [servo_yaw, servo_pitch] if outer == "yaw" else [servo_pitch, servo_yaw]
        seen = Rotation.from_euler(order, angles, degrees=True).apply([0.0, 0.0, 1.0])
        wanted = Rotation.from_euler("YX", [35 * yaw, 30 * pitch], degrees=True).apply([0.0, 0.0, 1.0])
        assert seen == pytest.approx(wanted)


@pytest.mark.parametrize("pitch_outside", [True, False])
def test_beyond_eighty_degrees_a_gimbal_stays_at_its_edge(pitch_outside: bool) -> None:
    gimbal = Gimbal(yaw_first=True, pitch_outside=pitch_outside)
    edge, beyond = gimbal.angles(np.array([80.0, -80.0]))
    assert not beyond
    for inputs in ([80.1, -80.0], [80.0, -80.1], [170.0, -1e6]):
        angles, beyond = gimbal.angles(np.array(inputs))
        assert beyond
        np.testing.assert_array_equal(angles, edge)


def test_the_ring_of_yaw_outside_takes_angles_as_they_are_and_the_order_of_inputs_is_that_of_the_file() -> None:
    np.testing.assert_array_equal(Gimbal(True, False).angles(np.array([12.0, -30.0]))[0], [12.0, -30.0])
    np.testing.assert_array_equal(Gimbal(False, False).angles(np.array([-30.0, 12.0]))[0], [12.0, -30.0])
    one, other = (
        Gimbal(first, True).angles(np.array(at))[0] for first, at in ((True, [12.0, -30.0]), (False, [-30.0, 12.0]))
    )
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    ("inputs", "channels", "said"),
    [
        ({"yaw": "headYaw", "roll": "headRoll"}, ["a", "b"], "a gimbal has yaw and pitch"),
        ({"yaw": "headYaw"}, ["a", "b"], "a gimbal has yaw and pitch"),
        ({"yaw": "headYaw", "pitch": "headPitch"}, ["a"], "channels"),
    ],
)
def test_a_gimbal_has_two_servos_and_two_inputs(inputs: dict[str, str], channels: list[str], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        read_linkage({"name": "eye", "kind": "gimbal", "channels": channels, "inputs": inputs})
