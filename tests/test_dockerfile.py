"""The Dockerfile of the examples, without Docker: its files are copied, and its very commands are run, in its order."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from drivers.packets.packet import Instruction, encode_instruction
from drivers.port.serialport import SerialPort

ROOT = Path(__file__).resolve().parent.parent
DOCKERFILE = ROOT / "examples" / "Dockerfile"
PAGE = ROOT / "docs" / "simulated-buses.md"
LINES = re.sub(r"\\\n", " ", DOCKERFILE.read_text(encoding="utf-8")).splitlines()
STEPS = [line.split(maxsplit=1) for line in LINES if line.strip() and not line.startswith("#")]
RUN_LINES = re.findall(r"^docker run .*$", PAGE.read_text(encoding="utf-8"), re.M)
LIMIT_S = 240.0

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name != "posix", reason="runs commands of a Linux container"),
    pytest.mark.filterwarnings("ignore:set:DeprecationWarning"),  # of pyserial's client of RFC 2217
]


@dataclass
class Container:
    """What the Dockerfile says of the container, with ``root`` in the place of its file system's root."""

    root: Path
    environment: dict[str, str]
    folder: Path = field(default_factory=Path)
    entry: list[str] = field(default_factory=list)
    command: list[str] = field(default_factory=list)
    stop: str = "SIGTERM"
    ports: list[str] = field(default_factory=list)

    def take(self, step: str, words: str) -> None:
        """Carry out one step; one that this test does not know fails."""
        if step == "WORKDIR":
            self.folder = self.root / words.lstrip("/")
            self.folder.mkdir(parents=True, exist_ok=True)
        elif step == "COPY":
            *sources, target = words.split()
            for source in sources:
                self._copy(ROOT / source, target)
        elif step == "RUN":
            subprocess.run(words, shell=True, cwd=self.folder, env=self.environment, check=True, timeout=LIMIT_S)
        elif step == "ENV":
            name, _, value = words.partition("=")
            self.environment[name] = str(self.root / value.lstrip("/")) if value.startswith("/") else value
        elif step == "EXPOSE":
            self.ports.append(words)
        elif step in ("ENTRYPOINT", "CMD"):
            setattr(self, {"ENTRYPOINT": "entry", "CMD": "command"}[step], json.loads(words))
        elif step == "STOPSIGNAL":
            self.stop = words
        else:
            assert step in ("FROM", "USER"), f"{step}: not known here"

    def _copy(self, source: Path, target: str) -> None:
        if source.is_dir():
            shutil.copytree(source, self.folder / target, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, self.folder / target)


@pytest.fixture(scope="module")
def container(tmp_path_factory: pytest.TempPathFactory) -> Container:
    """A virtual environment in the place of the image; pip installs into it, and takes dependencies from this one."""
    root = tmp_path_factory.mktemp("container")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(root / "usr")], check=True)
    (packages,) = (root / "usr" / "lib").glob("python3*/site-packages")
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    pip = shutil.which("pip", path=str(Path(sys.executable).parent)) or shutil.which("pip")
    if pip is None:
        pytest.skip("needs pip")
    made = Container(root, {"PATH": f"{root / 'usr' / 'bin'}{os.pathsep}{os.environ['PATH']}", "HOME": str(root)})
    shim = root / "usr" / "bin" / "pip"
    there = shlex.quote(str(root / "usr" / "bin" / "python"))
    shim.write_text(f'#!/bin/sh\nexec {shlex.quote(pip)} --python {there} "$@"\n')
    shim.chmod(0o755)
    made.environment |= {"PIP_NO_DEPS": "1", "PIP_NO_INDEX": "1", "PIP_NO_BUILD_ISOLATION": "0",
        "PIP_IGNORE_INSTALLED": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1", "PIP_QUIET": "1"}  # fmt: skip
    for step, words in STEPS:
        made.take(step, words)
    return made


@pytest.fixture(params=range(len(RUN_LINES)))
def words(request: pytest.FixtureRequest) -> list[str]:
    """What a line of the docs says behind the image's name."""
    line = shlex.split(RUN_LINES[request.param])
    return line[line.index("omote") + 1 :]


def test_the_docs_publish_the_port_that_the_image_exposes(container: Container) -> None:
    assert len(RUN_LINES) >= 2
    assert container.ports == ["4000"]
    assert container.command[-1].endswith(":4000")
    assert all("-p 4000:4000" in line for line in RUN_LINES)


def test_a_client_talks_to_the_servos_and_the_container_stops(container: Container, words: list[str]) -> None:
    with served(container, words or container.command) as ready:
        servo = ping2(ready) if "dynamixel" in (words or container.command) else ping1(ready)
        assert servo == 1


@contextmanager
def served(container: Container, words: list[str]) -> Iterator[str]:
    """Start what the container starts, at a port that is free; stop it as Docker does; it ends in the usual way."""
    free = [re.sub(r"^0\.0\.0\.0:4000$", "0.0.0.0:0", word) for word in words]
    assert free != words, "it listens where the port is published"
    command, pipe = [*container.entry, *free], subprocess.PIPE
    with subprocess.Popen(command, cwd=container.folder, env=container.environment, stdout=pipe, text=True) as program:
        try:
            assert program.stdout is not None
            line = program.stdout.readline()
            assert line.startswith("ready "), line
            yield line.split()[1].replace("0.0.0.0", "127.0.0.1")
        finally:
            program.send_signal(getattr(signal, container.stop))
            assert program.wait(LIMIT_S) in (0, 130)


def ping2(address: str) -> int:
    """Who answers a ping of servo 1 in Protocol 2.0."""
    return answer(address, encode_instruction(1, Instruction.PING, b""), 14)[4]


def ping1(address: str) -> int:
    """The same in Feetech's protocol."""
    return answer(address, bytes([255, 255, 1, 2, 1, 251]), 6)[2]


def answer(address: str, request: bytes, size: int) -> bytes:
    """So many bytes of the answer to a request."""
    port, data = SerialPort(address), b""
    port.open()
    try:
        port.write(request)
        end_s = port.clock() + 30.0
        while len(data) < size and port.clock() < end_s:
            data += port.read(end_s)
    finally:
        port.close()
    return data
