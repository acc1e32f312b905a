"""The console that commands print to."""

from __future__ import annotations

import os
import sys

from rich.console import Console
from rich.table import Table

from controller.tools.tables import fit_table


class Screen(Console):
    """Standard output, on which ``FORCE_COLOR`` forces colours only.

    rich itself would treat the output as a terminal and draw its progress bars into files and pipes.
    """

    def __init__(self) -> None:
        forced = bool(os.environ.get("FORCE_COLOR")) and not sys.stdout.isatty()
        super().__init__(highlight=False, emoji=False, color_system="standard" if forced else "auto")

    @property
    def is_terminal(self) -> bool:
        """Whether standard output is a terminal."""
        try:
            return self.file.isatty()
        except ValueError:  # it is closed
            return False


console = Screen()


def show_table(table: Table, console: Console = console) -> None:
    """Print a table: in its natural width to a file or a pipe, wrapped between words on a terminal.

    If the longest words of all columns do not fit side by side, every row is printed as a paragraph.
    """
    # only a terminal, or the variable COLUMNS, limits the width
    limit = console.width if console.is_terminal or os.environ.get("COLUMNS") else None
    for piece in fit_table(table, console, limit):
        console.print(piece, crop=False, soft_wrap=isinstance(piece, str))
