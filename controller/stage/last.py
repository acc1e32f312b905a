"""Remembers the stage that was last run in a window, so that ``omote run`` without a name opens it again."""

from __future__ import annotations

import json
import os
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from controller.base.errors import OMOTE_ERRORS
from controller.base.files import replacing
from surface.base.files import read_text

VARIABLE = "OMOTE_STATE"
"""Environment variable with another folder for omote's state."""
_MAX_BYTES = 1 << 16


@dataclass(frozen=True)
class LastStage:
    """A stage's file, and the vocabularies that were added to its own ones on the command line."""

    stage: Path
    vocabularies: tuple[Path, ...] = ()


def state_dir() -> Path:
    """Return the user's folder for the state of programs, by the convention of the operating system."""
    if named := os.environ.get(VARIABLE):
        return Path(named)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "omote"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "omote"
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "omote"


def remember(stage: Path, vocabularies: tuple[Path, ...] = ()) -> None:
    """Keep a stage as the last one. An error of writing is ignored, since it must not end the run."""
    table = {"stage": str(stage.resolve()), "vocabularies": [str(each.resolve()) for each in vocabularies]}
    with suppress(OSError, RuntimeError, *OMOTE_ERRORS):  # Path.home raises RuntimeError for a user without one
        path = state_dir() / "last.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary:
            temporary.write_text(json.dumps(table) + "\n", encoding="utf-8")


def last_stage() -> LastStage | None:
    """Return the stage that was kept, with the vocabularies that still exist; None if there is none."""
    try:
        table = json.loads(read_text(state_dir() / "last.json", _MAX_BYTES))
        stage, more = Path(table["stage"]), [Path(each) for each in table["vocabularies"]]
    except (OSError, RuntimeError, ValueError, KeyError, TypeError):
        return None
    return LastStage(stage, tuple(each for each in more if each.is_file())) if stage.is_file() else None
