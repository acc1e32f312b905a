"""The command line as a user meets it: help with examples, one message for what goes wrong, never a traceback."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from controller.base.errors import ConfigError
from controller.cli import app as module
from controller.cli.app import main, make_app, report_error

COMMANDS = [
    ("demo",),
    ("run",),
    ("play",),
    ("render",),
    ("fit",),
    ("ports",),
    ("scan",),
    ("set-id",),
    ("calibrate",),
    ("monitor",),
    ("check",),
    ("bench",),
    ("simulate", "dynamixel"),
    ("simulate", "feetech"),
    ("simulate", "maestro"),
    ("simulate", "ssc32"),
    ("simulate", "robot"),
    ("simulate", "host"),
]


Omote = Callable[..., "Said"]


class Said(NamedTuple):
    """What a command left: its exit code and what it wrote."""

    returncode: int
    stdout: str
    stderr: str


@pytest.fixture
def omote(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Omote:
    """Runs ``omote WORDS`` in a folder, by the entry point of the command but in this process."""

    def run(*words: str, cwd: Path | None = None) -> Said:
        monkeypatch.setattr(sys, "argv", ["omote", *words])
        if cwd is not None:
            monkeypatch.chdir(cwd)
        code = 0
        try:
            main()
        except SystemExit as end:
            code = int(end.code or 0)
        return Said(code, *capsys.readouterr())

    return run


def test_a_traceback_that_is_asked_for_is_pythons_own() -> None:
    assert make_app().pretty_exceptions_enable is False


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_every_command_has_help_with_an_example(command: tuple[str, ...]) -> None:
    result = CliRunner().invoke(make_app(), [*command, "--help"])
    assert result.exit_code == 0
    assert f"Example: omote {' '.join(command)}" in " ".join(result.output.split())


@pytest.mark.parametrize(
    ("words", "message", "hint"),
    [
        (("run", "nope"), "no stage 'nope'", "demo"),
        (("check", "nope"), "nope: no such file", "omote check demo"),
        (("play", "nope.csv"), "nope.csv: cannot be read", "ls -l"),
        (("render", "-o", "x.png", "--set", "jawOpn=1"), "did you mean 'jawOpen'", "arkit.toml"),
        (("render", "-o", "x.png", "--set", "jawOpen=nan"), "'nan' is not a number", ""),
        (("render", "-o", "x.png", "-e", "hapiness"), "did you mean 'happiness'", ""),
        (("render", "-o", "x.png", "--size", "big"), "expected WIDTHxHEIGHT", "800x800"),
        (("render", "-o", "x.png", "--head", "nobody"), "no head 'nobody'", "ict"),
        (("render", "-o", "no/such/x.png", "--size", "32x32"), "x.png", ""),
        (("fit", "nope.npz", "-o", "out"), "nope.npz", ""),
        (("scan", "/dev/not-there"), "/dev/not-there", "omote ports"),
        (("simulate", "dynamixel", "--ids", "1-300"), "ids go from 0 to 252", "--ids 1-24"),
        (("simulate", "dynamixel", "--model", "x"), "no control table for model 'x'", ""),
        (("simulate", "dynamixel", "--fault", "x:1"), "fault 'x:1'", "mute"),
        (("simulate", "robot", "nope"), "no robot 'nope'", "head24"),
        (("simulate", "host", "nope"), "no script 'nope'", "tour"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else None,
)
def test_wrong_input_is_one_message_with_the_next_step(
    omote: Omote, tmp_path: Path, words: tuple[str, ...], message: str, hint: str
) -> None:
    result = omote(*words, cwd=tmp_path)
    said = " ".join(result.stderr.split())
    assert result.returncode == 1
    assert said.startswith("error: ")
    assert message in said
    assert hint in said
    assert "Traceback" not in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_process_of_its_own_ends_with_that_code_and_says_it_on_stderr() -> None:
    command = [sys.executable, "-c", "from controller.cli.app import main; main()", "run", "nope"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False)
    assert result.returncode == 1
    assert result.stdout == ""
    assert result.stderr.startswith("error: ")


BACKGROUND = ("sh", "-c", 'trap "" INT; exec "$@"', "sh")


@pytest.mark.parametrize(
    ("module", "background"),
    [("controller.cli.app", ())]  # later ones also where a shell has had the signal ignored
    + [(module, way) for module in ("controller.base.errors", "rich.console", "controller.cli.run")
       for way in ((), BACKGROUND)],
    ids=str,
)  # fmt: skip
def test_an_interrupt_while_the_command_line_loads_says_nothing(module: str, background: tuple[str, ...]) -> None:
    program = """
import _signal, sys
from controller.cli import main

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == sys.argv[1]:
            _signal.raise_signal(_signal.SIGINT)

sys.meta_path.insert(0, Finder())
main()
"""
    command = [*background, sys.executable, "-c", program, module]
    result = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False)
    assert (result.returncode, result.stdout, result.stderr) == (130, "", "")


@pytest.mark.slow
def test_a_missing_or_busy_port_ends_a_run_with_one_message(omote: Omote, tmp_path: Path) -> None:
    stage = tmp_path / "stage.toml"
    stage.write_text('name = "mine"\n[[links]]\nport = "/dev/not-there"\n')
    result = omote("run", str(stage), "--headless", "--seconds", "2")
    said = " ".join(result.stderr.split())
    assert result.returncode == 1
    assert said.startswith("error: ")
    assert "/dev/not-there" in said
    assert "omote ports" in said
    assert "Traceback" not in said


def test_a_damaged_head_is_one_message(omote: Omote, tmp_path: Path, root: Path) -> None:
    head = tmp_path / "head"
    head.mkdir()
    shipped = root / "configs/heads/ict"
    (head / "head.toml").write_bytes((shipped / "head.toml").read_bytes())
    (head / "head.npz").write_bytes((shipped / "head.npz").read_bytes()[:50_000])
    result = omote("check", str(head))
    assert result.returncode == 1
    assert "head.npz" in " ".join(result.stderr.split())
    assert "Traceback" not in result.stderr


@pytest.mark.slow
def test_render_draws_what_it_is_told(omote: Omote, tmp_path: Path) -> None:
    pictures = []
    for name, words in (("rest", ()), ("open", ("--set", "jawOpen=0.8"))):
        out = tmp_path / f"{name}.png"
        result = omote("render", "-o", str(out), "--size", "160x200", *words)
        assert result.returncode == 0, result.stderr
        notes = result.stderr.splitlines()
        assert all(note.startswith("compiling the kernels") for note in notes), notes
        pictures.append(np.asarray(Image.open(out).convert("RGB")).astype(int))
    assert pictures[0].shape == (200, 160, 3)
    assert (np.abs(pictures[1] - pictures[0]).max(axis=2) > 24).mean() > 0.01


def test_check_names_what_is_good(omote: Omote) -> None:
    for name, said in (("demo", "stage demo"), ("head24", "24 channels")):
        result = omote("check", name)
        assert result.returncode == 0, result.stderr
        assert said in result.stdout
        assert "good" in result.stdout


@pytest.mark.slow
def test_dry_run_opens_nothing_and_lists_every_channel(omote: Omote) -> None:
    result = omote("run", "demo", "--dry-run")
    assert result.returncode == 0, result.stderr
    assert "no port was opened" in result.stdout
    assert result.stdout.count("xl330") == 24


@pytest.mark.parametrize(("words", "threads"), [(("ports", "--help"), "1"), (("fit", "--help"), None)])
def test_only_a_fit_lets_blas_have_threads(
    omote: Omote, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], threads: str | None
) -> None:
    monkeypatch.setattr(os, "environ", {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"})
    assert omote(*words).returncode == 0
    assert os.environ.get("OPENBLAS_NUM_THREADS") == threads


def raising(error: BaseException) -> Callable[[], Callable[[], None]]:
    """A command line that ends with an error."""

    def command() -> None:
        raise error

    return lambda: command


def test_every_kind_of_end_has_its_exit_code(omote: Omote, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OMOTE_DEBUG", raising=False)
    remark = "This is a fault in omote. OMOTE_DEBUG=1 shows where."
    for error, code, said in (
        (ConfigError("a [b] c", hint="type [d]"), 1, "error: a [b] c\ntry: type [d]\n"),
        (ConfigError("no hint"), 1, "error: no hint\n"),
        (KeyboardInterrupt(), 130, ""),
        (ZeroDivisionError("my fault"), 70, f"error: my fault\n{remark}\n"),
        (ZeroDivisionError(), 70, f"error: ZeroDivisionError\n{remark}\n"),
    ):
        monkeypatch.setattr(module, "make_app", raising(error))
        assert omote() == Said(code, "", said)
    monkeypatch.setenv("OMOTE_DEBUG", "1")
    with pytest.raises(ZeroDivisionError):
        omote()


@pytest.mark.slow
def test_a_reader_that_is_gone_ends_a_command_quietly() -> None:
    command = [sys.executable, "-c", "from controller.cli.app import main; main()", "plugins"]
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, text=True, timeout=240, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (1, "")


def test_interrupts_that_were_ignored_count_again_and_others_handlers_stay(
    omote: Omote, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "make_app", lambda *_: lambda: None)
    before = signal.getsignal(signal.SIGINT)
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        omote()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)

        def own(*_: object) -> None:
            pass

        signal.signal(signal.SIGINT, own)
        omote()
        assert signal.getsignal(signal.SIGINT) is own
    finally:
        signal.signal(signal.SIGINT, before)


def test_an_interrupt_that_a_module_swallows_ends_a_run_that_begins_later() -> None:
    """As a bare ``except:`` around an import does."""
    program = """
import _signal, sys
from controller.cli import main

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "controller.links.line.host":
            try:
                _signal.raise_signal(_signal.SIGINT)
            except:
                pass

sys.meta_path.insert(0, Finder())
main()
"""
    command = [sys.executable, "-c", program, "simulate", "dynamixel", "--ids", "1"]
    assert subprocess.run(command, stdout=subprocess.DEVNULL, timeout=120, check=False).returncode == 0


def test_an_interrupt_in_a_callback_of_python_ends_the_command_quietly() -> None:
    """As in the one that ends the lock of an import, where Python prints what is raised and goes on."""
    program = """
import _signal, sys, weakref
from controller.cli import main

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "controller.links.line.host":
            seen = Finder()
            watch = weakref.ref(seen, lambda _: _signal.raise_signal(_signal.SIGINT))
            del seen

sys.meta_path.insert(0, Finder())
main()
"""
    command = [sys.executable, "-c", program, "simulate", "dynamixel", "--ids", "1"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert result.returncode in (0, 130) and result.stderr == ""


def test_ctrl_c_while_a_class_is_made_is_no_fault_of_omote(monkeypatch: pytest.MonkeyPatch) -> None:
    def app() -> None:
        raise RuntimeError("Error calling __set_name__") from KeyboardInterrupt()

    monkeypatch.setattr(module, "make_app", lambda *_: app)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 130


def test_what_the_system_has_run_out_of_is_no_fault_of_omote(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def app() -> None:
        raise OSError(24, "Too many open files")

    monkeypatch.delenv("OMOTE_DEBUG", raising=False)
    monkeypatch.setattr(module, "make_app", lambda *_: app)
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr().err
    assert (
        ended.value.code == 1 and "Too many open files" in said and "ulimit -n" in said and "fault in omote" not in said
    )


def test_long_messages_are_not_broken_and_numbers_not_coloured(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    monkeypatch.setenv("FORCE_COLOR", "1")
    report_error(ConfigError("word 17 " * 20, hint="more 9 " * 20), "remark")
    text = capsys.readouterr().err
    assert [line.count(word) for line, word in zip(text.splitlines(), ("word", "more", "remark"), strict=True)] == [
        20, 20, 1
    ]  # fmt: skip
    assert "word 17 word" in text and "\x1b[1;31merror:" in text and "\x1b[2mremark" in text


def test_messages_show_what_was_typed(capsys: pytest.CaptureFixture[str]) -> None:
    """Names that rich takes for pictures, colours and escapes."""
    typed = r"nonsense:x: [red]a[/] :smile: \[b] \\[b] c\\"
    report_error(ConfigError(typed, hint=typed))
    assert capsys.readouterr().err == f"error: {typed}\ntry: {typed}\n"


def test_a_name_of_megabytes_is_shortened_in_its_middle(capsys: pytest.CaptureFixture[str]) -> None:
    report_error(ConfigError(f"a.toml: 2 faults\n  {'x' * 600}\n  {'y' * 2_000_000}.step", hint="z" * 601))
    first, second, third, hint = capsys.readouterr().err.splitlines()
    assert first == "error: a.toml: 2 faults"
    assert second.startswith("  xx") and second.endswith(" ... (2 more characters) ... " + "x" * 300)
    assert third == f"  {'y' * 298} ... (1999407 more characters) ... {'y' * 295}.step"
    assert hint.endswith(" ... (1 more characters) ... " + "z" * 300)


def test_no_words_show_the_help_and_short_help_works(omote: Omote) -> None:
    for words in ((), ("-h",), ("--help",)):
        said = omote(*words)
        assert "Drives a robot's face" in said.stdout + said.stderr
        for command in ("set-id", "plugins", "export", "simulate"):
            assert command in said.stdout + said.stderr
        assert "--install-completion" in said.stdout + said.stderr
    for words in (("simulate",), ("run", "-h")):
        said = omote(*words)
        assert "Usage" in said.stdout + said.stderr


def test_the_version_is_that_of_the_installation(omote: Omote) -> None:
    assert omote("--version") == Said(0, f"omote {version('omote')}\n", "")


@pytest.mark.parametrize(
    ("words", "meant"), [(("rnu",), "run"), (("simulate", "maestor"), "maestro"), (("simulate", "robto"), "robot")]
)
def test_a_mistyped_command_names_the_one_that_was_meant(omote: Omote, words: tuple[str, ...], meant: str) -> None:
    said = omote(*words)
    assert said.returncode == 2
    assert f"No such command {words[-1]!r}. Did you mean {meant!r}?" in said.stderr


def test_a_command_that_resembles_none_is_refused(omote: Omote) -> None:
    said = omote("simulate", "xyzzy")
    assert said.returncode == 2 and "No such command 'xyzzy'." in said.stderr and "mean" not in said.stderr


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ("run demo --web", "run demo --web 127.0.0.1:8080"),
        ("run --web demo", "run --web 127.0.0.1:8080 demo"),
        ("run demo --web --headless", "run demo --web 127.0.0.1:8080 --headless"),
        ("run demo --web 0.0.0.0:80 --headless", "run demo --web 0.0.0.0:80 --headless"),
        ("run demo --headless", "run demo --headless"),
        ("export a.glb --web", "export a.glb --web"),
    ],
)
def test_the_web_panel_has_an_address_where_none_is_given(words: str, wanted: str) -> None:
    assert module.with_web_address(["omote", *words.split()]) == ["omote", *wanted.split()]


@pytest.mark.parametrize("number", [errno.EACCES, errno.ENAMETOOLONG, errno.EROFS])
def test_a_file_that_may_not_be_used_is_no_fault_of_omote(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], number: int
) -> None:
    def app() -> None:
        raise OSError(number, os.strerror(number), "/home/other/head.toml")

    monkeypatch.delenv("OMOTE_DEBUG", raising=False)
    monkeypatch.setattr(module, "make_app", lambda *_: app)
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr().err
    assert ended.value.code == 1 and "fault in omote" not in said
    assert f"error: /home/other/head.toml: {os.strerror(number)}\ntry: look at: ls -ld /home/other/head.toml" in said
