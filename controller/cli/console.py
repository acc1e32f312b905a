"""The console that commands print to: codes that move the cursor only on a terminal, even where colours are forced."""

from __future__ import annotations

import os
import sys

from rich.console import Console


class Screen(Console):
    """Standard output. rich takes ``FORCE_COLOR`` for a terminal and would draw its progress bars into files and pipes;
    here it means colours only.
    """

    def __init__(self) -> None:
        forced = bool(os.environ.get("FORCE_COLOR")) and not sys.stdout.isatty()
        super().__init__(highlight=False, color_system="standard" if forced else "auto")

    @property
    def is_terminal(self) -> bool:
        """Whether standard output is a terminal."""
        try:
            return self.file.isatty()
        except ValueError:  # it is closed
            return False


console = Screen()
