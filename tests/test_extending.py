"""docs/extending.md: its driver and its link, installed as one foreign package, are known to everything in omote."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

FILE = re.compile(r"^`([\w./]+)`:\n\n```\w+\n(.*?)^```$", re.M | re.S)
MOST_LINES = 100

ROBOT = """
name = "puppet"
[[buses]]
name = "head"
kind = "{kind}"
{more}
[[channels]]
name = "jaw"
bus = "head"
id = 1
model = "rc-180"
mix = {{ jawOpen = 1 }}
map = {{ at = [0, 1], deg = [0, 20] }}
limit_deg = [0, 20]
max_speed_deg_s = 100
max_accel_deg_s2 = 1000
"""
STAGE = """
name = "foreign"
robots = ["robot.toml"]
[[links]]
kind = "jsonudp"
listen = "127.0.0.1:{port}"
"""
PROGRAM = """
import contextlib, io, json, sys
from controller.cli import main
for words in sys.argv[1:]:
    sys.argv, out, err, code = ["omote", *words.split()], io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main()
        except SystemExit as end:
            code = end.code or 0
    print(json.dumps([code, out.getvalue(), err.getvalue()]), flush=True)
"""


class Said(NamedTuple):
    """What a command left: its exit code and what it wrote."""

    returncode: int
    stdout: str
    stderr: str


Omote = Callable[..., list[Said]]


@pytest.fixture(scope="session")
def page(root: Path) -> str:
    return (root / "docs" / "extending.md").read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def site(page: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that holds the package of the page as an installer would leave it."""
    source, site = tmp_path_factory.mktemp("package"), tmp_path_factory.mktemp("site")
    for name, text in FILE.findall(page):
        (source / name).parent.mkdir(exist_ok=True)
        (source / name).write_text(text, encoding="utf-8")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(source / "dist")]
    subprocess.run(build, cwd=source, check=True, capture_output=True, timeout=120)
    with zipfile.ZipFile(next((source / "dist").glob("*.whl"))) as wheel:
        wheel.extractall(site)
    return site


@pytest.fixture
def omote(site: Path, root: Path, tmp_path: Path) -> Omote:
    """Runs commands of ``omote`` where the package is installed, in a folder of its own; all by one process."""

    def run(*commands: str) -> list[Said]:
        command = [sys.executable, "-c", PROGRAM, *commands]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment(site, root), capture_output=True, text=True, timeout=120
        )
        assert done.returncode == 0, done.stderr
        return [Said(*json.loads(line)) for line in done.stdout.splitlines()]

    return run


def environment(site: Path, root: Path) -> dict[str, str]:
    plain = {name: value for name, value in os.environ.items() if not name.startswith("OMOTE_")}
    return plain | {"PYTHONPATH": os.pathsep.join([str(site), str(root)]), "COLUMNS": "200"}


def test_the_examples_are_short(page: str) -> None:
    lines: dict[str, int] = {}
    for name, text in FILE.findall(page):
        folder = name.partition("/")[0]
        lines[folder] = lines.get(folder, 0) + sum(bool(line.strip()) for line in text.splitlines())
    folders = {folder for folder in lines if folder != "pyproject.toml"}
    assert folders == {"omote_puppet8", "omote_jsonudp", "omote_lever", "omote_pairs", "omote_track", "omote_xyz"}
    assert all(count < MOST_LINES for count in lines.values()), lines


@pytest.mark.slow
def test_the_driver_passes_what_every_driver_must_pass(page: str, site: Path, root: Path, tmp_path: Path) -> None:
    block = page.partition("## Testing a driver")[2].partition("```python\n")[2].partition("```")[0]
    test = tmp_path / "test_puppet8.py"
    test.write_text(block, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-c", os.devnull, str(test)],
        cwd=root, env=environment(site, root), capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert int(re.search(r"(\d+) passed", done.stdout)[1]) >= 12, done.stdout  # type: ignore[index]


@pytest.mark.slow
def test_every_list_has_them(omote: Omote) -> None:
    plugins, simulators, simulator = omote("plugins", "simulate --help", "simulate puppet8 --help")
    for word in ("puppet8", "Puppet8 boards", "jsonudp", "lever", "pairs", "track", "xyz", "omote-example 0.1.0"):
        assert word in plugins.stdout
    assert "puppet8" in simulators.stdout
    assert "57600" in simulator.stdout and "Example: omote simulate puppet8" in simulator.stdout


@pytest.mark.slow
def test_robot_files_and_stages_are_checked_by_their_own_options(omote: Omote, tmp_path: Path) -> None:
    def robot(name: str, kind: str, more: str) -> None:
        (tmp_path / name).write_text(ROBOT.format(kind=kind, more=more))

    robot("good.toml", "puppet8", 'port = "/dev/null"\noffset = 8\nstagger_s = 0.1')
    robot("wrong.toml", "puppet8", 'port = "/dev/null"\noffset = 300\nofset = 1')
    robot("other.toml", "maestro", 'port = "/dev/null"\noffset = 8')
    robot("unknown.toml", "puppet9", 'port = "/dev/null"')
    robot("robot.toml", "simulated", 'simulates = "puppet8"')
    (tmp_path / "stage.toml").write_text(STAGE.format(port=9400))
    (tmp_path / "far.toml").write_text(STAGE.format(port=94000))
    names = ("good", "wrong", "other", "unknown", "stage", "far")
    said = dict(zip(names, omote(*(f"check {name}.toml" for name in names)), strict=True))
    assert said["good"].returncode == 0
    assert "buses[0].offset" in said["wrong"].stderr and "less than or equal to 120" in said["wrong"].stderr
    assert "buses[0].ofset: unknown key, did you mean 'offset'?" in said["wrong"].stderr
    assert "offset is not for maestro, but for puppet8" in said["other"].stderr
    assert "unknown bus kind 'puppet9', did you mean 'puppet8'?" in said["unknown"].stderr
    assert "jsonudp on 127.0.0.1:9400" in said["stage"].stdout
    assert "links[0]: listen: must be HOST:PORT" in said["far"].stderr


@pytest.mark.slow
def test_a_stage_runs_with_both(site: Path, root: Path, tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    (tmp_path / "robot.toml").write_text(ROBOT.format(kind="simulated", more='simulates = "puppet8"'))
    (tmp_path / "stage.toml").write_text(STAGE.format(port=port))
    words = ["run", "stage.toml", "--headless", "--no-face", "--seconds", "4", "--report", "report.json"]
    command = [sys.executable, "-c", "from controller.cli import main; main()", *words]
    with (tmp_path / "said").open("w") as said:
        running = subprocess.Popen(command, cwd=tmp_path, env=environment(site, root), stdout=said, stderr=said)
    deadline = time.monotonic() + 120.0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        while running.poll() is None:
            sender.sendto(json.dumps({"jawOpen": 0.5}).encode(), ("127.0.0.1", port))
            sender.sendto(b"no json", ("127.0.0.1", port))
            time.sleep(0.05)
            if time.monotonic() > deadline:
                running.kill()
    assert running.returncode == 0, (tmp_path / "said").read_text()
    report = json.loads((tmp_path / "report.json").read_text())
    (link,) = report["links"]
    assert link["accepted"] > 0 and link["refused"]["JSONDecodeError"] > 0
    (bus,) = report["buses"]
    assert bus["bus"]["writes"] > 0 and bus["bus"]["errors"] == {}


@pytest.mark.slow
def test_a_linkage_is_checked_and_moves_its_servo(omote: Omote, tmp_path: Path) -> None:
    text = """
name = "lever"
buses = [{ name = "b", kind = "simulated" }]
[[linkages]]
name = "jaw"
kind = "lever"
channels = ["jaw"]
inputs.way = { jawOpen = 10 }
horn_mm = 20
[[channels]]
name = "jaw"
bus = "b"
id = 1
model = "xl330-m288"
map = { at = [-90, 90], deg = [-90, 90] }
limit_deg = [-90, 90]
max_speed_deg_s = 300
max_accel_deg_s2 = 3000
"""
    (tmp_path / "lever.toml").write_text(text)
    (tmp_path / "wrong.toml").write_text(text.replace("inputs.way", "inputs.wey"))
    (tmp_path / "stage.toml").write_text('name = "s"\nrobots = ["lever.toml"]\n')
    (tmp_path / "open.csv").write_text("time,jawOpen\n0,1\n1,1\n")
    good, wrong, played = omote("check lever.toml", "check wrong.toml", "play open.csv --stage stage.toml --dry-run")
    assert good.returncode == 0, good.stderr
    assert "a lever has one channel, the input way (mm)" in wrong.stderr
    assert "30.0" in played.stdout  # asin of 10 mm in 20


@pytest.mark.slow
def test_a_take_and_an_exported_head_go_through_them(omote: Omote, tmp_path: Path) -> None:
    (tmp_path / "a.track").write_text("jawOpen headYaw\n0 0 0\n0.5 1 0.2\n1.0 0 0\n")
    (tmp_path / "b.track").write_text("jawOpen\n0 x\n")
    take, bad, head, stl = omote(
        "check a.track", "check b.track", "export head.xyz --set jawOpen=0.5", "export head.stl"
    )  # fmt: skip
    assert "take a.track: 3 frames, 1.0 s" in take.stdout
    assert bad.returncode == 1 and "b.track: is no table" in bad.stderr and "a line of names" in bad.stderr
    assert head.returncode == 0
    assert len((tmp_path / "head.xyz").read_text().splitlines()) > 30_000
    assert ".xyz" in stl.stderr


@pytest.mark.slow
def test_a_format_has_a_link_and_is_translated(omote: Omote, tmp_path: Path) -> None:
    (tmp_path / "a.track").write_text("jawOpen headYaw\n0 0 0\n0.05 1 0.2\n")
    link = '[[links]]\nkind = "pairs"\nlisten = "{}"\nmirror = true\n'
    (tmp_path / "good.toml").write_text('name = "good"\n' + link.format("127.0.0.1"))
    (tmp_path / "open.toml").write_text('name = "open"\n' + link.format("0.0.0.0"))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10)
        address = f"pairs:127.0.0.1:{receiver.getsockname()[1]}"
        good, far, translated = omote("check good.toml", "check open.toml", f"translate a.track {address}")
        assert receiver.recv(1000) == b"jawOpen=0;headYaw=0" and receiver.recv(1000) == b"jawOpen=1;headYaw=0.2"
    assert "pairs on udp:127.0.0.1:9403" in good.stdout
    assert far.returncode == 1 and "open_to_network = true allows it" in far.stderr
    assert translated.returncode == 0 and "2 messages sent" in translated.stderr
