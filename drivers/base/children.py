"""Starting a module of this program as a process of its own, wherever the program is installed or was started from.

The child finds everything where its parent found it: it gets the parent's module path, in the same order, and nothing
of the folder that happens to be the current one. Imports nothing that takes long.
"""

from __future__ import annotations

import os
import sys

_HOME = "PYTHONHOME"


def command(module: str, *words: str, bare: bool = False) -> list[str]:
    """What starts a module by its dotted name.

    Parameters
    ----------
    words : arguments.
    bare : without what ``site`` and its start-up files do, which takes time and may fail.
    """
    return [sys.executable or "python3", "-P", *(["-S"] if bare else []), "-m", module, *words]


def environment(module: str, *, bare: bool = False) -> dict[str, str]:
    """The environment to start it in.

    Parameters
    ----------
    bare : without the variables by which a user tells Python how to run, but for where it lives.
    """
    kept = {
        name: value for name, value in os.environ.items() if not bare or not name.startswith("PYTHON") or name == _HOME
    }
    return kept | {"PYTHONPATH": os.pathsep.join(module_path(module))}


def module_path(module: str) -> list[str]:
    """Folders in which this process finds modules; last the one that holds the package, however it was found."""
    package = sys.modules.get(module.partition(".")[0])
    folders = [*sys.path, *(os.path.dirname(folder) for folder in getattr(package, "__path__", ()))]
    return list(dict.fromkeys(os.path.abspath(folder) for folder in folders if isinstance(folder, str)))
