"""controller.hardware.service: files that systemd's and udev's own parsers read, and that say what they shall."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest
import tomli_w

from controller.base.errors import ConfigError, ControllerError
from controller.hardware import service as module
from controller.hardware.service import Adapter, rules_text, unit_text, write_service
from drivers.testing import open_servos

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="for Linux")

BY_ID = "/dev/serial/by-id/usb-FTDI_USB__-__Serial_Converter_FT6RW5Q1-if00-port0"
ADAPTERS = [
    Adapter("head", "main", BY_ID, "FT6RW5Q1", "omote-head-main"),
    Adapter("head", "b", "/dev/x", "", "omote-b"),
]


def robot(folder: Path, port: str = BY_ID, name: str = "my head") -> Path:
    channel = {
        "name": "jaw", "bus": "main", "id": 1, "model": "xl330-m288", "mix": {"jawOpen": 1.0},
        "map": {"at": [0, 1], "deg": [0, 15]}, "limit_deg": [-5, 20], "max_speed_deg_s": 200, "max_accel_deg_s2": 2000,
    }  # fmt: skip
    path = folder / "my-robot.toml"
    bus = {"name": "main", "kind": "dynamixel", "port": port}
    path.write_text(tomli_w.dumps({"name": name, "buses": [bus], "channels": [channel]}), encoding="utf-8")
    return path


def has_verify(program: str) -> bool:
    """Whether udevadm or systemd-analyze is here and knows ``verify``."""
    if shutil.which(program) is None:
        return False
    said = subprocess.run([program, "--help"], capture_output=True, text=True, check=False)
    return "verify" in said.stdout + said.stderr


def test_the_unit_passes_systemd_s_own_check(tmp_path: Path) -> None:
    if not has_verify("systemd-analyze"):
        pytest.skip("systemd-analyze verify is not installed here")
    written, _ = write_service(str(robot(tmp_path)), tmp_path / "out", "root")
    (unit,) = [path for path in written if path.suffix == ".service"]
    done = subprocess.run(["systemd-analyze", "verify", unit], capture_output=True, text=True, timeout=60, check=False)
    about_it = [line for line in done.stderr.splitlines() if unit.name in line]
    assert about_it == []
    assert done.returncode == 0


def test_the_check_finds_a_unit_that_is_wrong(tmp_path: Path) -> None:
    """So that the test above can fail."""
    if not has_verify("systemd-analyze"):
        pytest.skip("systemd-analyze verify is not installed here")
    wrong = tmp_path / "omote-wrong.service"
    wrong.write_text(unit_text("head", tmp_path / "s.toml", "root", []).replace("WatchdogSec", "WatchdogSecs"))
    done = subprocess.run(["systemd-analyze", "verify", wrong], capture_output=True, text=True, timeout=60, check=False)
    assert "WatchdogSecs" in done.stderr


def test_the_rules_pass_udev_s_own_check(tmp_path: Path) -> None:
    if not has_verify("udevadm"):
        pytest.skip("udevadm verify comes with systemd 254")
    rules = tmp_path / "99-omote.rules"
    rules.write_text(rules_text("head", ADAPTERS))
    done = subprocess.run(["udevadm", "verify", rules], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr


KEYS = r"ACTION|SUBSYSTEMS?|DRIVER|ATTRS?\{\w+\}|SYMLINK|GROUP|MODE|TAG"


def test_the_rules_have_the_form_of_the_manual_page() -> None:
    """udev(7): comma-separated KEY OPERATOR "value"; == compares, = and += assign, and a rule does both."""
    text = rules_text("head", ADAPTERS)
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    assert len(lines) == 4
    for line in lines:
        parts = line.split(", ")
        assert all(re.fullmatch(rf'(?:{KEYS})(==|\+=|=)"[^"]*"', part) for part in parts), line
        compares = [part for part in parts if "==" in part]
        assert 0 < len(compares) < len(parts)
    assert 'ATTRS{serial}=="FT6RW5Q1"' in text
    assert 'SYMLINK+="omote-head-main"' in text
    assert 'ATTR{latency_timer}="1"' in text
    assert 'GROUP="dialout"' in text


def test_adapters_without_a_known_number_share_one_rule() -> None:
    unknown = [Adapter("head", name, f"/dev/{name}", "", f"omote-{name}") for name in ("a", "b")]
    text = rules_text("head", unknown)
    assert text.count('SUBSYSTEM=="tty"') == 1 and "# bus a of head" in text and "# bus b of head" in text


def test_the_unit_runs_the_stage_watches_it_and_waits_for_the_adapter(tmp_path: Path) -> None:
    text = unit_text("my head", tmp_path / "a b%.toml", "omote", ADAPTERS)
    (command,) = re.findall(r"^ExecStart=(.*)$", text, re.M)
    program, *words = shlex.split(command.replace("%%", "%").replace("$$", "$"))
    assert Path(program).name == "omote"
    assert words == ["run", str(tmp_path / "a b%.toml"), "--no-face"]
    times = {"WatchdogSec=10", "TimeoutStartSec=90", "TimeoutStopSec=45"}
    assert {"Type=notify", "Restart=on-failure", "KillSignal=SIGTERM", "ProtectSystem=strict"} | times <= set(
        text.splitlines()
    )
    escape = shutil.which("systemd-escape")
    device = r"dev-omote\x2dhead\x2dmain.device"
    assert f"After={device}" in text
    if escape:
        done = subprocess.run([escape, "-p", "--suffix=device", "/dev/omote-head-main"], capture_output=True, text=True)
        assert done.stdout.strip() == device


def test_the_files_of_a_robot_have_a_stage_and_the_commands(tmp_path: Path) -> None:
    written, commands = write_service(str(robot(tmp_path)), tmp_path / "out", "omote")
    names = sorted(path.name for path in written)
    assert names == ["99-omote-my-head.rules", "INSTALL.txt", "my-head.stage.toml", "omote-my-head.service"]
    stage = tomllib.loads((tmp_path / "out/my-head.stage.toml").read_text(encoding="utf-8"))
    assert stage["robots"] == [str((tmp_path / "my-robot.toml").resolve())]
    assert any('port = "/dev/omote-my-head-main"' in line for line in commands)
    assert any("udevadm control --reload" in line for line in commands)
    assert any("systemctl enable --now omote-my-head.service" in line for line in commands)
    assert (tmp_path / "out/INSTALL.txt").read_text(encoding="utf-8").splitlines() == commands


def test_a_serial_number_comes_from_the_adapter_that_is_plugged_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = SimpleNamespace(device="/dev/ttyUSB7", by_id=None, serial_number="ABC123")
    monkeypatch.setattr(module, "list_ports", lambda: [record])
    written, commands = write_service(str(robot(tmp_path, "/dev/ttyUSB7")), tmp_path / "out", "omote")
    assert 'ATTRS{serial}=="ABC123"' in written[1].read_text(encoding="utf-8")
    monkeypatch.setattr(module, "list_ports", list)
    written, commands = write_service(str(robot(tmp_path, "/dev/ttyUSB7")), tmp_path / "out", "omote")
    assert "ATTRS" not in written[1].read_text(encoding="utf-8")
    assert any("plug in the adapter of main" in line for line in commands)


def test_a_stage_without_a_robot_needs_no_service_and_a_simulated_one_no_rules(tmp_path: Path) -> None:
    stage = tmp_path / "stage.toml"
    stage.write_text(tomli_w.dumps({"name": "s", "control_hz": 100.0}), encoding="utf-8")
    with pytest.raises(ConfigError, match="needs no service"):
        write_service(str(stage), tmp_path / "out", "omote")
    stage.write_text(tomli_w.dumps({"name": "s", "robots": ["head24"]}), encoding="utf-8")
    written, _ = write_service(str(stage), tmp_path / "out", "omote")
    assert sorted(path.name for path in written) == ["INSTALL.txt", "omote-s.service"]
    assert str(stage) in (tmp_path / "out/omote-s.service").read_text(encoding="utf-8")


@pytest.mark.parametrize(("user", "name"), [("Root!", ""), ("omote", "///")])
def test_names_that_nobody_has_are_refused(tmp_path: Path, user: str, name: str) -> None:
    with pytest.raises(ControllerError):
        write_service(str(robot(tmp_path)), tmp_path / "out", user, name)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_the_program_of_the_unit_tells_that_it_lives_and_ends_with_torque_off(tmp_path: Path) -> None:
    """The command of the unit with a socket in systemd's place: READY, pings, SIGTERM, and no motor on."""
    with open_servos("xl330-m288", [1]) as servos, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        systemd.settimeout(60.0)
        written, _ = write_service(str(robot(tmp_path, servos.port)), tmp_path / "out", "omote")
        unit = next(path for path in written if path.suffix == ".service").read_text(encoding="utf-8")
        command = shlex.split(re.findall(r"^ExecStart=(.*)$", unit, re.M)[0])
        environment = {**os.environ, "NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "300000"}
        with subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as omote:
            try:
                assert systemd.recv(64) == b"READY=1"
                assert servos.servo(1).torque
                assert [systemd.recv(64) for _ in range(3)] == [b"WATCHDOG=1"] * 3
                omote.terminate()
                while (said := systemd.recv(64)) == b"WATCHDOG=1":
                    pass
                assert said == b"STOPPING=1"
                omote.wait(timeout=60)
            finally:
                omote.kill()
        assert not servos.servo(1).torque
        servos.torque_off_at_exit()
