"""The command line: options, help and exit codes of ``omote``.

In: command-line arguments. Out: calls of controller.tools. Imports any other package of omote.
"""

import sys

__all__ = ["main"]


def main() -> None:
    """Run the ``omote`` command; Ctrl-C ends it without a traceback, also while its modules are imported."""
    try:
        from controller.cli import app  # imported lazily: it loads modules of Python that an interrupt could hit

        app.main()
    except KeyboardInterrupt:
        sys.exit(130)
