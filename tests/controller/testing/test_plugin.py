"""controller.testing.plugin: the fixtures as a stranger's tests get them, each run by pytest itself."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import entry_points

import pytest

import drivers.testing  # noqa: F401

pytest_plugins = ["pytester"]

ALONE = ("-p", "no:xdist", "-p", "no:hypothesispytest", "-p", "no:cacheprovider")
"""Plug-ins that these tests do without; hypothesis takes seconds."""


def test_it_is_installed() -> None:
    found = [each for each in entry_points(group="pytest11") if each.name == "omote"]
    assert [each.value for each in found] == ["controller.testing.plugin"], "make setup installs it"


def test_it_loads_nothing_before_a_fixture_is_used() -> None:
    """Runs of pytest that have nothing to do with robots load it, too."""
    heavy = "('numpy', 'numba', 'pydantic', 'serial', 'drivers', 'surface')"
    code = f"import sys, controller.testing.plugin; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_servo_bus_finds_the_jump_and_closes_the_port(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("""
        import os, serial

        ports = []
        PING = bytes.fromhex("FFFFFD0001030001194E")

        def test_ports(servo_bus):
            first, second = servo_bus("xl330-m288", [1, 2]), servo_bus({7: "sts3215"})
            ports.extend([first.port, second.port])
            with serial.Serial(first.port, 1_000_000, timeout=10) as port:
                port.write(PING)
                assert len(port.read(14)) == 14
            assert first.servo(2).position_ticks == 2048 and second.servo(7).position_ticks == 2048
            first.no_jump()
            second.torque_off_at_exit()

        def test_ports_are_closed():
            assert len(ports) == 2

        def test_a_wrong_model(servo_bus):
            servo_bus("xl331")
    """)
    result = pytester.runpytest_inprocess(*ALONE)
    result.assert_outcomes(passed=2, failed=1)
    result.stdout.fnmatch_lines(["*DriverError*xl331*", "*xl330-m288*"])


def test_servo_board_robot_head_and_robot_host(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("""
        import serial

        def test_board(servo_board):
            board = servo_board("maestro", channels=6)
            with serial.Serial(board.port, 115_200) as port:
                port.write(bytes([0x84, 0, 0x70, 0x2E]))
                board.wait_until(lambda: board.channels[0].target == 1500)
            assert servo_board("omote", stepped=True).channels[58].key == "value", "all parameters"

        def test_head(robot_head):
            head = robot_head("head-feetech")
            assert head.servo("jaw").torque is False
            head.torque_off_at_exit()

        def test_host(robot_host):
            host = robot_host(steps=["0 PING"])
            with serial.Serial(host.port, 115_200, timeout=10) as port:
                assert b"HELLO" in port.read_until()
    """)
    pytester.runpytest_inprocess(*ALONE).assert_outcomes(passed=3)
