"""controller.testing.head: the simulated buses of a robot file, driven by omote's own drivers and by a bare program."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
import serial

from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS
from controller.robot.channels import servo_specs
from controller.robot.robot import load_robot
from controller.testing.head import open_head
from drivers import open_bus
from drivers.base.errors import DriverError
from drivers.packets.packet import Instruction, encode_instruction


def test_omotes_own_driver_drives_it_well(tmp_path: Path) -> None:
    with open_head("head24", folder=tmp_path, wire=True) as head:  # else a quick machine sends more than a wire carries
        robot = load_robot(head.file, PARAMETERS)
        (bus,) = robot.buses
        assert (bus.kind, bus.port) == ("dynamixel", head.port)
        head.servo("jawOpen").place(2010)
        with open_bus(bus.kind, servo_specs(robot.channels), **bus.options()) as driver:
            driver.start()
            for _ in range(40):
                driver.write(np.full(24, 0.05))
                driver.read()
                time.sleep(0.01)
            assert head.servo("jawOpen").torque
            with pytest.raises(AssertionError, match="still has its torque on"):
                head.torque_off_at_exit()
        head.no_jump()
        head.never_beyond_limits()
        head.torque_off_at_exit()
        head.bus_load_below(1.0)


def test_limits_of_the_file_count(tmp_path: Path) -> None:
    with open_head("head24", folder=tmp_path) as head, serial.Serial(head.port, 1_000_000, timeout=10) as port:
        jaw = next(each for each in load_robot(head.file, PARAMETERS).channels if each.name == "jawOpen")
        port.write(encode_instruction(jaw.id, Instruction.WRITE, b"\x74\0" + (4000).to_bytes(4, "little")))
        assert len(port.read(11)) == 11
        with pytest.raises(AssertionError, match=rf"servo {jaw.id} .*Goal Position = 4000 .*its limits are \d+ to \d+"):
            head.never_beyond_limits()
        head.forget()
        head.never_beyond_limits()


def test_a_board_has_the_limits_of_its_pulses(tmp_path: Path) -> None:
    with open_head("eyes-maestro", folder=tmp_path, port="tcp") as head:
        board = head.buses["eyes"] if "eyes" in head.buses else next(iter(head.buses.values()))
        with serial.serial_for_url(head.port, timeout=10) as port:
            port.write(bytes((0x84, 0, 1500 * 4 & 0x7F, 1500 * 4 >> 7)))
            board.wait_until(lambda: board.writes)
            head.never_beyond_limits()
            head.no_jump()
            port.write(bytes((0x84, 0, 1530 * 4 & 0x7F, 1530 * 4 >> 7)))
            board.wait_until(lambda: len(board.writes) > 1)
            head.no_jump(deg=2.8)  # 30 us are 2.7 degrees of a hobby servo
            with pytest.raises(AssertionError, match="jump"):
                head.no_jump(deg=2.6)
        with pytest.raises(AssertionError, match="channel 0 is still on"):
            head.torque_off_at_exit()
        with pytest.raises(KeyError, match="no servo"):
            head.servo("anything")


def test_faults_and_what_is_wrong_are_told(tmp_path: Path) -> None:
    with open_head("head-feetech", folder=tmp_path, faults=["mute:1"]) as head:
        assert [bus.faults for bus in head.buses.values()] == [["mute:1"]]
        head.clear()
        head.fault("late:*:5ms")
        assert [bus.faults for bus in head.buses.values()] == [["late:*:5ms"]]
    with pytest.raises(ConfigError, match="head-fetech"):
        open_head("head-fetech", folder=tmp_path)
    with pytest.raises(DriverError, match="no port of kind"):
        open_head("head-feetech", folder=tmp_path, port="usb")
