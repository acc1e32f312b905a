"""Remembers the stage that was run in a window last, so that it is opened where none is named."""

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
"""Environment variable that names another folder for what omote remembers."""
_MOST_BYTES = 1 << 16


@dataclass(frozen=True)
class LastStage:
    """A stage: its file, and vocabularies that it was run with behind its own ones."""

    stage: Path
    vocabularies: tuple[Path, ...] = ()


def state_dir() -> Path:
    """The user's folder for what programs remember, by the custom of the operating system."""
    if named := os.environ.get(VARIABLE):
        return Path(named)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "omote"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "omote"
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "omote"


def remember(stage: Path, vocabularies: tuple[Path, ...] = ()) -> None:
    """Keep a stage as the last one; where nothing can be written it is not kept, which is no fault of the run."""
    table = {"stage": str(stage.resolve()), "vocabularies": [str(each.resolve()) for each in vocabularies]}
    with suppress(OSError, RuntimeError, *OMOTE_ERRORS):  # RuntimeError: nobody's home
        path = state_dir() / "last.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary:
            temporary.write_text(json.dumps(table) + "\n", encoding="utf-8")


def last_stage() -> LastStage | None:
    """The stage that was kept, with those of its vocabularies that are still there; None where there is none."""
    try:
        table = json.loads(read_text(state_dir() / "last.json", _MOST_BYTES))
        stage, more = Path(table["stage"]), [Path(each) for each in table["vocabularies"]]
    except (OSError, RuntimeError, ValueError, KeyError, TypeError):
        return None
    return LastStage(stage, tuple(each for each in more if each.is_file())) if stage.is_file() else None
