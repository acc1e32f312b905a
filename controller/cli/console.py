"""Where the commands write: a terminal's tricks only on a terminal, also where colours are forced."""

from __future__ import annotations

import os
import sys

from rich.console import Console


class Screen(Console):
    """Standard output; what is written into a file or a pipe has no codes that move a cursor.

    rich takes ``FORCE_COLOR`` for a terminal and would draw its progress bars anywhere. Here it means colours.
    """

    def __init__(self) -> None:
        forced = bool(os.environ.get("FORCE_COLOR")) and not sys.stdout.isatty()
        super().__init__(highlight=False, color_system="standard" if forced else "auto")

    @property
    def is_terminal(self) -> bool:
        """Whether somebody watches."""
        try:
            return self.file.isatty()
        except ValueError:  # it is closed
            return False


console = Screen()
