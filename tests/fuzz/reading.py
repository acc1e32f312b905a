"""Reads one file in this process as the command line does, and returns omote's exit code."""

from __future__ import annotations

import os
import resource
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

from typer.main import get_command

from controller.base.errors import OMOTE_ERRORS
from controller.base.paths import find_config
from controller.cli import app
from controller.tools.check import DEFAULT_HEAD
from surface import check as checker
from surface.check import check_head as look
from surface.head.model import file
from surface.readers import rhino


def run_command(words: Sequence[str]) -> int:
    """Run ``omote`` with words of the command line."""
    sys.argv = ["omote", *words]
    try:
        app.main()
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    return 0


def check(path: Path) -> int:
    """``omote check`` of a file; of its folder where it belongs to a head.

    Defects of a head's form are looked for, but do not count: the head that is damaged here is a small sheet.
    """
    if path.parent.name != "head":
        return run_command(["check", str(path)])
    with patch.object(checker, "check_head", lambda head: look(head)[:0]):
        return run_command(["check", str(path.parent)])


def reports(read: Callable[[Path], object]) -> Callable[[Path], int]:
    """What a command reads before it goes on, with the errors that are reported for it."""

    def run(path: Path) -> int:
        try:
            read(path)
        except OMOTE_ERRORS as error:
            app.report_error(error)
            return 1
        return 0

    return run


@contextmanager
def quickened() -> Iterator[None]:
    """No work is done again for each file: commands are put together once, the shipped head that groups belong to is
    read once, and .3dm files are tried in a forked process.
    """
    command = get_command(app.make_app())
    shipped, load = find_config("heads", DEFAULT_HEAD), file.load_data
    head = load(shipped)
    with (
        patch.object(app, "make_app", lambda *_: command),
        patch.object(file, "load_data", lambda path: head if path == shipped else load(path)),
        patch.object(rhino, "_is_readable", _tried_in_fork),
    ):
        yield


def _data_bytes() -> int:
    """Bytes of memory that this process has of its own (proc(5), VmData in kB)."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("VmData"))


def _tried_in_fork(data: bytes) -> bool:
    """As the reader's own trial, in a process that need not start the interpreter."""
    import rhino3dm

    child = os.fork()
    if child == 0:
        code = 1
        try:
            signal.setitimer(signal.ITIMER_PROF, rhino.PATIENCE_S + len(data) / rhino.BYTES_PER_S)
            most = _data_bytes() + rhino.MAX_BYTES + rhino.GROWTH * len(data)
            resource.setrlimit(resource.RLIMIT_DATA, (most, most))
            code = int(rhino3dm.File3dm.FromByteArray(data) is None)
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
