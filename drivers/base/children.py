"""Command line and environment to run a module of this program in a child process.

The child gets the module search path of its parent, so that it imports the same modules, and not the current folder.
"""

from __future__ import annotations

import os
import sys

from drivers.base.permission import check_ports_allowed


def command(module: str, *words: str, bare: bool = False) -> list[str]:
    """Return the command line that runs a module, by its dotted name, with arguments; `bare` skips the ``site`` module.

    Raises PortError where ports are forbidden, because the child would not be bound by that.
    """
    check_ports_allowed(f"start {module}")
    return [sys.executable or "python3", "-P", *(["-S"] if bare else []), "-m", module, *words]


def environment(module: str, *, bare: bool = False) -> dict[str, str]:
    """Return the environment of the child; `bare` leaves out all PYTHON* variables but PYTHONHOME."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if not bare or not name.startswith("PYTHON") or name == "PYTHONHOME"
    }
    return kept | {"PYTHONPATH": os.pathsep.join(module_path(module))}


def module_path(module: str) -> list[str]:
    """Folders in which this process searches modules, followed by the one that holds the package of `module`."""
    package = sys.modules.get(module.partition(".")[0])
    folders = [*sys.path, *(os.path.dirname(folder) for folder in getattr(package, "__path__", ()))]
    return list(dict.fromkeys(os.path.abspath(folder) for folder in folders if isinstance(folder, str)))
