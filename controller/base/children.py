"""Child processes that are started by the name of a module: they run this omote, wherever they are started."""

from __future__ import annotations

import os
import sys
import sysconfig
from pathlib import Path

_HOME = Path(__file__).resolve().parents[2]


def module_command(module: str) -> list[str]:
    """The start of a command line that runs ``module``; run it with :func:`child_environment`.

    ``-P`` leaves out the folder it is started from: a user's own ``controller`` or ``json.py`` there is none of ours.
    """
    return [sys.executable, "-P", "-m", module]


def child_environment() -> dict[str, str]:
    """This process's environment, in which a child also finds an omote that is not installed."""
    environment = dict(os.environ)
    if str(_HOME) not in {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}:
        places = environment.get("PYTHONPATH", "").split(os.pathsep)
        environment["PYTHONPATH"] = os.pathsep.join([str(_HOME), *(p for p in places if p and p != str(_HOME))])
    return environment
