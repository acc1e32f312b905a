"""The command line: options, help and exit codes of ``omote``.

In: words. Out: calls of controller.tools. Imports any room left of it.
"""

from controller.cli.app import main

__all__ = ["main"]
