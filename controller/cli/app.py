"""The ``omote`` command line: registers all commands, and turns every error into one message and an exit code.

Each command imports the code it needs when it runs, so that ``omote --help`` and the simulated parts start at once.
"""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs
    from types import FrameType

    from typer import Typer  # imported lazily: Ctrl-C ends omote quietly while this still loads

_RETRY_S = 0.01
"""Delay before an interrupt that Python could not raise is raised again."""
_MAX_LINE_LENGTH = 600
"""Characters that are printed of a line of an error message."""
WEB = "127.0.0.1:8080"
"""Default address of ``--web``."""


def _run_commands() -> tuple[Callable[..., None], ...]:
    from controller.cli import run  # imported lazily: only the commands that need it load it

    return run.demo, run.run, run.edit, run.play, run.convert


def _head_commands() -> tuple[Callable[..., None], ...]:
    from controller.cli import heads, landmarks  # imported lazily: as above

    return heads.render, heads.fit, landmarks.landmarks, heads.export


def _hardware_commands() -> tuple[Callable[..., None], ...]:
    from controller.cli import bus, hardware  # imported lazily: as above

    return bus.ports, bus.scan, bus.set_id, bus.monitor, bus.calibrate, hardware.preflight, hardware.service


def _other_commands() -> tuple[Callable[..., None], ...]:
    from controller.cli import bench, check, study, translate, webcam  # imported lazily: as above

    return check.check, check.plugins, bench.bench, translate.translate, webcam.webcam, study.study


COMMANDS = (
    (("demo", "run", "edit", "play", "convert"), _run_commands),
    (("render", "fit", "landmarks", "export"), _head_commands),
    (("ports", "scan", "set-id", "monitor", "calibrate", "preflight", "service"), _hardware_commands),
    (("check", "plugins", "bench", "translate", "webcam", "study"), _other_commands),
)
"""Names of commands and the function that imports them, in the order of ``omote --help``. The group ``simulate`` is
added separately."""


def make_app(only: str = "") -> Typer:
    """Return the app with all commands, or, which is faster, with only the group that contains the command ``only``."""
    # imported lazily: main() ends Ctrl-C quietly from its first line on, also while these load
    from typer import Typer

    from controller.cli import version  # imported lazily: as above

    app = Typer(
        name="omote",
        help="Drives a robot's face: a CG face and a servo head that make the same expression.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode="rich",
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    chosen = [load for names, load in COMMANDS if only in names]
    for load in chosen or [load for _, load in COMMANDS]:
        for command in load():
            app.command()(command)
    if not chosen:
        from controller.cli import simulate  # imported lazily: as above

        app.add_typer(simulate.make_app(), name="simulate")
    app.callback()(version.root)
    return app


def _shorten_lines(text: str) -> str:
    """Omit the middle of every very long line of a message: a name from a damaged file may have megabytes."""
    half = _MAX_LINE_LENGTH // 2
    return "\n".join(
        line if len(line) <= _MAX_LINE_LENGTH
        else f"{line[:half]} ... ({len(line) - 2 * half} more characters) ... {line[-half:]}"
        for line in text.split("\n")
    )  # fmt: skip


def report_error(error: BaseException, remark: str = "") -> None:
    """Print what failed and what to do next on standard error."""
    # imported lazily: Ctrl-C ends omote quietly from main() on
    from rich.console import Console
    from rich.text import Text

    console = Console(stderr=True, highlight=False, soft_wrap=True)
    with suppress(OSError):  # if standard error cannot be written either, the exit code reports the failure
        message = _shorten_lines(str(error)) or type(error).__name__
        console.print(Text.assemble(("error:", "bold red"), f" {message}"))
        if hint := getattr(error, "hint", ""):
            console.print(Text.assemble(("try:", "bold"), f" {_shorten_lines(hint)}"))
        if remark:
            console.print(Text(remark, "dim"))


def _is_interrupt(error: BaseException | None) -> bool:
    """Whether Ctrl-C caused an error: Python wraps exceptions that are raised while a class is created."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__
    return error is not None


class Interrupt:
    """Handler of Ctrl-C that raises KeyboardInterrupt and records it.

    C code, or an ``except:`` in a module that is being imported, may swallow the exception; without the record, a run
    would begin although the user has interrupted it.

    came : whether an interrupt came; see :func:`controller.base.signals.stop_flag`.
    """

    def __init__(self) -> None:
        self.came, self._report = False, sys.unraisablehook

    def __call__(self, number: int, frame: FrameType | None) -> None:
        self.came = True
        raise KeyboardInterrupt

    def retry_lost(self, lost: UnraisableHookArgs) -> None:
        """Interrupt again if Python could not raise the exception, as in a callback of its import system."""
        if issubclass(lost.exc_type, KeyboardInterrupt):
            self.came = False
            threading.Timer(_RETRY_S, _thread.interrupt_main).start()
        else:
            self._report(lost)


def main() -> None:
    """Run the ``omote`` command. Installs the handler of Ctrl-C before it imports anything."""
    # a shell ignores the signal in programs that it starts in the background; they stay so
    if signal.getsignal(signal.SIGINT) in (signal.SIG_IGN, signal.default_int_handler):
        signal.signal(signal.SIGINT, handler := Interrupt())
        sys.unraisablehook = handler.retry_lost
    try:
        sys.exit(_run())
    except KeyboardInterrupt:
        sys.exit(130)


def with_web_address(arguments: list[str]) -> list[str]:
    """Return the command line with the default address after an ``omote run --web`` that has none."""
    if arguments[1:2] != ["run"] or "--web" not in arguments:
        return arguments
    i = arguments.index("--web") + 1
    has_address = i < len(arguments) and ":" in arguments[i] and not arguments[i].startswith("-")
    return arguments if has_address else [*arguments[:i], WEB, *arguments[i:]]


def _run() -> int:
    """Run the command of this process; returns its exit code."""
    # imported lazily: main() ends Ctrl-C quietly
    from controller.base.errors import OMOTE_ERRORS
    from controller.cli.streams import fault_of, prepare_streams

    prepare_streams()
    if sys.argv[1:2] != ["fit"]:  # before numpy is imported: its threads only help with large equations, as of a fit
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    sys.argv[:] = with_web_address(sys.argv)
    try:
        make_app(*sys.argv[1:2])()
        code = 0
    except SystemExit as end:
        code = int(end.code or 0)
    except OMOTE_ERRORS as error:
        report_error(error)
        code = 1
    except Exception as error:  # noqa: BLE001  reported, or raised again
        if not (isinstance(error, OSError) and error in (fault_of(sys.stdout), fault_of(sys.stderr))):
            return _report_unexpected(error)
        code = 1
    fault = fault_of(sys.stdout)
    if fault is not None and not isinstance(fault, BrokenPipeError):  # a closed pipe means that the reader has enough
        report_error(OSError(f"standard output cannot be written: {fault.strerror}"))
    return code or int(fault is not None)


def _report_unexpected(error: Exception) -> int:
    """Report an error that no command expected; returns the exit code."""
    from controller.base.errors import denied, exhausted  # imported lazily: main() ends Ctrl-C quietly

    if _is_interrupt(error):
        return 130
    if os.environ.get("OMOTE_DEBUG"):
        raise error
    if (plain := exhausted(error) or denied(error)) is not None:
        report_error(plain)
        return 1
    report_error(error, "This is a fault in omote. OMOTE_DEBUG=1 shows where.")
    return 70
