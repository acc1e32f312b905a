"""The command line: options, help and exit codes of ``omote``.

In: words. Out: calls of controller.tools. Imports any room left of it.
"""

import sys

__all__ = ["main"]


def main() -> None:
    """Entry point of the ``omote`` command: Ctrl-C ends it quietly from here on, also while its modules load."""
    try:
        from controller.cli import app  # imported lazily: it loads modules of Python that an interrupt could hit

        app.main()
    except KeyboardInterrupt:
        sys.exit(130)
