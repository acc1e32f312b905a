"""Command line and environment that start a module of this program as a child process with the same module path.

The child imports modules from where its parent does, in the same order, and not from the current folder.
"""

from __future__ import annotations

import os
import sys

from drivers.base.permission import check_ports_allowed


def command(module: str, *words: str, bare: bool = False) -> list[str]:
    """The command line that runs a module, by its dotted name, with arguments; `bare` skips the ``site`` module.

    Raises PortError where ports are forbidden, because the child does not know of that.
    """
    check_ports_allowed(f"start {module}")
    return [sys.executable or "python3", "-P", *(["-S"] if bare else []), "-m", module, *words]


def environment(module: str, *, bare: bool = False) -> dict[str, str]:
    """The environment of the child; `bare` leaves out every variable of Python's but PYTHONHOME."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if not bare or not name.startswith("PYTHON") or name == "PYTHONHOME"
    }
    return kept | {"PYTHONPATH": os.pathsep.join(module_path(module))}


def module_path(module: str) -> list[str]:
    """Folders in which this process finds modules; last the one that holds the package of `module`."""
    package = sys.modules.get(module.partition(".")[0])
    folders = [*sys.path, *(os.path.dirname(folder) for folder in getattr(package, "__path__", ()))]
    return list(dict.fromkeys(os.path.abspath(folder) for folder in folders if isinstance(folder, str)))
