"""tests.clients: what runs other people's programs fails where it shall, here with libraries that omote itself has."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

from tests import clients
from tests.clients import __main__ as program_of_clients
from tests.clients.__main__ import HERE, result, run

SERVOS: dict[str, Any] = {"model": "xl330-m288", "ids": [1, 2, 3]}
BOARD: dict[str, Any] = {"board": "maestro", "options": {"channels": 12}}
ON = "import serial, sys\nwith serial.Serial(sys.argv[1], 115200) as port:\n    port.write(bytes([0x84, 0, 112, 46]))\n"
OFF = "    port.write(bytes([0x84, 0, 0, 0]))\n"
STAYS_STILL = "import sys\n"
JUMPS = """
import sys
from dynamixel_sdk import PacketHandler, PortHandler
port, packets = PortHandler(sys.argv[1]), PacketHandler(2.0)
port.openPort()
def until(done):  # replies are late on a busy machine, which the SDK answers with an IndexError
    while True:
        try:
            if done():
                return
        except IndexError:
            pass
until(lambda: packets.write1ByteTxRx(port, 1, 64, 1)[0] == 0)
until(lambda: packets.write4ByteTxRx(port, 1, 116, 3000)[0] == 0)
until(lambda: packets.read4ByteTxRx(port, 1, 132)[0] >= 2990)
until(lambda: packets.write1ByteTxRx(port, 1, 64, 0)[0] == 0)
"""


def program(folder: Path, text: str) -> dict[str, str]:
    path = folder / "program.py"
    path.write_text(text, encoding="utf-8")
    return {"program": str(path)}


def test_a_gentle_program_passes() -> None:
    passed, said = result(sys.executable, {**SERVOS, "program": "dynamixel_sdk_program.py"})
    assert passed and said.startswith("passed"), said  # at the second try on a busy machine


@pytest.mark.parametrize(
    ("bench", "text", "said"),
    [
        (SERVOS, JUMPS, "servo 1 (xl330-m288) went"),
        (SERVOS, STAYS_STILL, "it moved nothing"),
        (SERVOS, "raise SystemExit('no answer')", "no answer"),
        (BOARD, ON, "channel 0 is still on"),
        (BOARD, ON + OFF, ""),
    ],
)
def test_what_is_said_of_a_program(bench: dict[str, Any], text: str, said: str, tmp_path: Path) -> None:
    wrong = run(sys.executable, {**bench, **program(tmp_path, text)})
    assert said in wrong
    assert bool(wrong) == bool(said)


def test_the_second_try_of_a_program_is_told(tmp_path: Path) -> None:
    mark = tmp_path / "tried"
    first = f"import pathlib\nmark = pathlib.Path({str(mark)!r})\nif not mark.exists():\n    mark.touch()\n"
    text = first + "    raise SystemExit('no status packet')\n" + ON + OFF
    client = {**BOARD, **program(tmp_path, text)}
    assert result(sys.executable, client) == (True, "passed at the second try; the first: no status packet")
    client |= program(tmp_path, "raise SystemExit('no status packet')")
    assert result(sys.executable, client) == (False, "no status packet")


def test_every_client_has_pinned_versions_and_a_program_and_is_in_the_docs() -> None:
    known = tomllib.loads((HERE / "clients.toml").read_text(encoding="utf-8"))
    page = Path(clients.__file__).parents[2] / "docs/simulated-buses.md"
    table = page.read_text(encoding="utf-8").partition("## Programs of others")[2].partition("\n## ")[0]
    assert {client["program"] for client in known.values()} == {path.name for path in (HERE / "programs").glob("*.py")}
    for name, client in known.items():
        for package in [*client["packages"], *client.get("bare", [])]:
            assert "==" in package or len(package.rpartition("@")[2]) == 40, name
        pin = (client.get("bare") or client["packages"])[-1]
        version = pin.partition("==")[2] or pin.rpartition("@")[2][:12]
        assert f"| {version} |" in table, name


def test_a_client_that_cannot_be_installed_is_a_row_and_the_others_run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def environment(name: str, packages: list[str], bare: list[str]) -> Path:
        if name == "pypot":
            raise subprocess.CalledProcessError(1, "pip", stderr="looking\nERROR: no index\n")
        return Path(sys.executable)

    monkeypatch.setattr(program_of_clients, "environment", environment)
    monkeypatch.setattr(program_of_clients, "result", lambda python, client: (True, "passed"))
    monkeypatch.setenv("COLUMNS", "200")
    assert program_of_clients.main(["pypot", "rustypot"]) == 1
    said = capsys.readouterr().out
    assert "ERROR: no index" in said and "passed" in said
