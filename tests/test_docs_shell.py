"""Every shell line of README, CONTRIBUTING and docs is run, or checked by a rule that says why it is not run.

A shell line is a line of a code block without a language, or a piece of text in backticks, that begins with a program.
Ports, files and placeholders of a reader become those of the test; what would go on until a person ends it gets a time.
A line that no rule covers fails.
"""

from __future__ import annotations

import functools
import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
import wave
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer.main

from controller.cli.app import make_app
from drivers.sim import SimulatedBus
from surface.head import save_data
from tests.surface.small_head import small_head

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")])
PROGRAM = r"(?:omote|make|python|pip|ffmpeg|arecord|sudo|fuser|apt-get|git|sh|bash|cd|mkdir|export)"
SHELL_LINE = re.compile(rf"^{PROGRAM} ")
QUOTED = re.compile(r"`([^`\n]+)`")
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
PROJECT = (ROOT / "pyproject.toml").read_text(encoding="utf-8")

READERS = {
    "/dev/ttyUSB0": "{port}", "PORT": "{port}", "STAGE": "my-stage.toml", "TAKE": "a.tsv", "FILE": "a.tsv",
    "FOLDER": "small", "ROBOT": "head24", "NAME": "head24", "OLD": "1", "NEW": "12", "MESH": "me.glb",
    "...": "dynamixel", "configs/stages/serial.toml": "serial.toml", "heads/me": "small",
    "myhead.toml": "my-robot.toml", "livelink:127.0.0.1:11111": "livelink:127.0.0.1:27311",
    "my-show.mp4": "my-show.webp", "configs/scripts/tour.toml": "my-show.toml",
    "configs/scripts/choir.toml": "my-show.toml",
}  # fmt: skip
"""What only a reader has, and what the test has in its place; the other names are files that the test writes."""
MORE = {
    "run": ["--no-face", "--seconds", "0.3"], "play": ["--no-face", "--seconds", "0.3"],
    "monitor": ["--seconds", "0.3"], "translate": ["--seconds", "0.3"],
    "scan": ["--baud", "1000000"], "render": ["--size", "32x32"],
}  # fmt: skip
"""Options that end a command soon; the last one counts where a line has the same."""
PARSED = {"simulate", "edit", "calibrate", "preflight", "fit", "landmarks", "bench", "webcam", "study"}
"""Commands that serve until they are interrupted, open a window, wait for keys, or work for minutes: their options are
parsed only."""
MESSAGES = {"omote needs Python 3.11 or newer": MAKEFILE}
"""Messages that begin like a command, and the file that prints them."""

RUNNER = """
import contextlib, io, json, os, sys, tempfile
import surface.check
from controller.cli.app import main
surface.check.check_head = lambda head: []  # it takes seconds, finds fault with a small head, and has its own tests

class Said(io.StringIO):  # what is written to its descriptor goes elsewhere
    def fileno(self):
        return elsewhere.fileno()

elsewhere = tempfile.TemporaryFile()
for line in json.load(open(sys.argv[1])):
    sys.argv, out, err, code = line["words"], Said(), io.StringIO(), 0
    os.dup2(os.open(line["input"], os.O_RDONLY), 0)
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main()
        except SystemExit as end:
            code = end.code or 0
    print(json.dumps([line["line"], code, out.getvalue() + err.getvalue()]), flush=True)
"""
LIVELINK = "Timecode,JawOpen\n0:0:0:0,0.1\n0:0:0:6,0.4\n0:0:0:12,0.1\n"
ROBOT = (ROOT / "configs" / "robots" / "head24.toml").read_text(encoding="utf-8")


def shell_lines(text: str) -> Iterator[str]:
    """The shell lines of a page."""
    language: str | None = None
    for line in text.splitlines():
        if line.startswith("```"):
            language = line[3:].strip() if language is None else None
        elif language is None:
            yield from (words for words in QUOTED.findall(line) if SHELL_LINE.match(words))
        elif language in ("", "sh", "bash", "console"):
            words = re.sub(r"\s+#.*", "", line).removeprefix("$ ").strip()
            if SHELL_LINE.match(words):
                yield words


LINES = sorted({line for page in PAGES for line in shell_lines(page.read_text(encoding="utf-8"))})
PIPED = re.compile(r"^(?:arecord|ffmpeg) .*\| (omote .*)$")
"""A program that records a voice: what follows the pipe hears a file."""
OMOTE = {line: (found[1] if (found := PIPED.match(line)) else line) for line in LINES if "omote " in line}
RUN = [
    line for line, own in OMOTE.items()
    if line not in MESSAGES and own.split()[1] not in PARSED and "--role" not in own and " " in own[6:]
]  # fmt: skip
"""Processes of one stage wait for each other: those with a role are run together by tests/controller/fleet."""


def words_of(line: str, port: str = "PORT") -> list[str]:
    """The words of a line of omote with what the test has in the place of what a reader has."""
    words = [READERS.get(word, word).replace("{port}", port) for word in shlex.split(OMOTE[line])]
    if words[1] == "export":
        words = [
            word if before == "--take" else word.replace("a.tsv", "head.glb") for before, word in pairwise(["", *words])
        ]
    if "--frame" in words or (words[1:3] == ["export", "head.glb"] and "--vocabulary" in words):  # the head must fit
        words = ["ict" if word == "small" else word for word in words]
    elif (words[1] == "export" or {"--sheet", "--take"} & set(words)) and not {"--head", "--person"} & set(words):
        words += ["--head", "small"]
    return [*words, *([] if "--dry-run" in words else MORE.get(words[1], []))]


def example(page: str, line: str) -> str:
    """The first example of a TOML file on a page that has a line."""
    blocks = re.findall(r"```toml\n(.*?)```", (ROOT / "docs" / page).read_text(encoding="utf-8"), re.DOTALL)
    return next(block for block in blocks if line in block)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a reader: a robot, a stage, a take, a voice, a recording's place, expressions, a group."""
    here = tmp_path_factory.mktemp("reader")
    (here / "my-robot.toml").write_text(ROBOT)
    (here / "my-stage.toml").write_text('name = "mine"\nrobots = ["my-robot.toml"]\n')
    (here / "mine").write_text((here / "my-stage.toml").read_text())
    serial = (ROOT / "configs" / "stages" / "serial.toml").read_text(encoding="utf-8")
    (here / "serial.toml").write_text(re.sub(r'(?m)^port = ".*"', 'port = "simulated"', serial))
    (here / "my-show.toml").write_text('steps = ["0 EXPR smile 1"]\n')
    (here / "a.tsv").write_text("0.0\taa\n0.4\tsil\n")
    (here / "take.csv").write_text(LIVELINK)
    with wave.open(str(here / "voice.wav"), "wb") as file:
        file.setparams((1, 2, 16_000, 0, "NONE", ""))
        file.writeframes((9000 * np.sin(np.arange(16_000) * 0.1)).astype("<i2").tobytes())
    (here / "hello.wav").write_bytes((here / "voice.wav").read_bytes())
    (here / "mine.toml").write_text(
        "[glee]\nweights = { mouthSmile = 1 }\n"
        '[parameters.dimple]\nregion = "mouth"\nprofile = "mouth"\ngroup = "dimple.json"\n'
        '[parameters.fold_1]\nregion = "mouth"\nprofile = "mouth"\ngroup = "dimple.json"\n'
    )
    (here / "me.toml").write_text("[ranges]\njawOpen = [0, 0.6]\n")
    (here / "dimple.json").write_text('{"format": 1, "name": "dimple", "part": "face", "ids": [1], '
                                      '"moves_mm": [[0, 0, 1]]}')  # fmt: skip
    (here / "voice.raw").write_bytes((here / "voice.wav").read_bytes()[44:])
    (here / "bad-minute.toml").write_bytes((ROOT / "examples" / "bad-minute.toml").read_bytes())
    (here / "bus.log").write_text("# omote traffic = 1\n# servos = 1:xl330-m288\n0 > ff ff fd 00 01 03 00 01 19 4e\n")
    (here / "phone.toml").write_text(example("links.md", 'kind = "livelink"'))
    (here / "ears.toml").write_text(example("expression.md", "[parameters.earLeft]"))
    (here / "out").mkdir()
    save_data(here / "small", small_head())
    return here


@pytest.fixture(scope="module")
def said(folder: Path) -> Iterator[dict[str, tuple[int, str]]]:
    """Exit code and text of every line that is run, by the line, in two processes; those about recordings in order, and
    those that listen at one port in the same process."""
    recorded = sorted((line for line in RUN if "a.rec" in line), key=lambda line: "--record" not in line)
    once = {tuple(words_of(line)): line for line in RUN if line not in recorded}
    listening = [line for line in once.values() if "--web" in line or "run websocket" in line]
    others = [line for line in once.values() if line not in listening]
    with SimulatedBus([1, 2]) as bus, SimulatedBus([1, 2]) as other:
        first = start(folder / "first.json", recorded + others[::2], bus.path)
        second = start(folder / "second.json", listening + others[1::2], other.path)
        running = [first, second]
        outputs = [process.communicate(timeout=600) for process in running]
    assert [process.returncode for process in running] == [0, 0], outputs
    lines = [json.loads(line) for out, _ in outputs for line in out.splitlines()]
    found = {line: (code, text) for line, code, text in lines}
    yield {line: found[line if line in recorded else once[tuple(words_of(line))]] for line in RUN}


def start(own: Path, lines: list[str], port: str) -> subprocess.Popen[str]:
    """A process that runs lines one after the other, in the folder of the file that it reads them from."""
    folder = own.parent
    own.write_text(json.dumps([orders(folder, line, port) for line in lines]))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "COLUMNS": "100"}
    pipe = subprocess.PIPE
    command = [sys.executable, "-c", RUNNER, str(own)]
    return subprocess.Popen(command, cwd=folder, env=environment, stdout=pipe, stderr=pipe, text=True)


def orders(folder: Path, line: str, port: str) -> dict[str, Any]:
    """What a process is told of a line: its words, and the file that is its standard input."""
    heard = "voice.raw" if "--voice-rate" in line else "voice.wav" if "-" in line.split() else os.devnull
    return {"line": line, "words": words_of(line, port=port), "input": str(folder / heard)}


@pytest.mark.slow
@pytest.mark.parametrize("line", RUN)
def test_a_line_runs(line: str, said: dict[str, tuple[int, str]]) -> None:
    code, text = said[line]
    if "no OpenGL" in text:
        pytest.skip("needs OpenGL without a display")
    assert code == 0, text


# ---------------------------------------------------------------------------- lines that are not run, by rule


@functools.cache
def command_of_omote() -> Any:
    """The whole command, built once."""
    return typer.main.get_command(make_app())


def parse(line: str) -> None:
    """Read the words of a line as omote does, without running it; of a command that is only mentioned, ask for help."""
    words = words_of(line)[1:]
    with pytest.raises(SystemExit) as end:  # --help ends the command after its other options were read
        command_of_omote()([*words, "--help"])
    assert end.value.code == 0
    if len(line.split()) > 2:
        command, rest = command_of_omote(), words
        while hasattr(command, "get_command"):
            command, rest = (
                command.get_command(command.make_context("omote", rest, resilient_parsing=True), rest[0]),
                rest[1:],
            )
        command.make_context("omote", rest)


def has_target(line: str) -> None:
    """A target of the Makefile, and variables that it knows."""
    _, target, *variables = line.split()
    assert re.search(rf"^{target}:.*## ", MAKEFILE, re.M)
    assert all(re.search(rf"^{each.partition('=')[0]} \?=|\({each.partition('=')[0]}\)", MAKEFILE, re.M)
               for each in variables)  # fmt: skip


def has_packages(line: str) -> None:
    """Packages that pyproject.toml names, with extras that it has, or the checkout itself."""
    extras = tomllib.loads(PROJECT)["project"]["optional-dependencies"]
    for word in shlex.split(line)[2:]:
        name, _, extra = word.partition("[")
        assert name in ("--editable", ".", "omote") or name in PROJECT, word
        assert not extra or extra.rstrip("]") in extras, word


def has_program(line: str) -> None:
    """A script or a module of the checkout, or code that imports what is there."""
    first, *more = shlex.split(line)[1:]
    if first == "-m":
        module = ROOT / more[0].replace(".", "/")
        assert module.with_suffix(".py").is_file() or (module / "__main__.py").is_file()
    elif first == "-c":
        exec(more[0].partition(";")[0])
    else:
        assert (ROOT / first).is_file()


def is_printed(line: str) -> None:
    """A message that begins like a command."""
    assert line in MESSAGES[line]


RULES: tuple[tuple[str, Callable[[str], object]], ...] = (
    ("omote needs", is_printed),
    ("omote ", parse),
    ("make ", has_target),
    ("python -m http.server", lambda line: None),  # of Python itself; it serves until it is interrupted
    ("pip install", has_packages),
    ("python ", has_program),
    ("git clone https://", lambda line: None),  # needs the network
    ("sudo apt-get install", lambda line: None),  # changes the system of whoever reads it
    ("sudo usermod", lambda line: None),  # the same
    ("sudo setserial", lambda line: None),  # the same
    ("export NUMBA_CACHE_DIR=/", lambda line: None),  # a variable of numba
    ("fuser -v ", lambda line: None),  # a program of the system
)
"""What is checked of a line that is not run, by how it begins; the first that fits."""


@pytest.mark.parametrize("line", [line for line in LINES if line not in RUN])
def test_a_line_that_is_not_run_is_checked(line: str) -> None:
    rules = [rule for begin, rule in RULES if line.startswith(begin)]
    assert rules, f"no rule covers {line!r}: run it, or add a rule that says why not"
    rules[0](line)


def test_lines_are_found_in_blocks_and_in_text() -> None:
    page = "`omote ports` and `port`\n```\nomote check a   # good\n> SET\n```\n`make x`\n```python\nomote.no()\n```\n"
    assert list(shell_lines(page)) == ["omote ports", "omote check a", "make x"]
    assert len(RUN) > 25
