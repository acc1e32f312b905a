"""A contact sheet and a clip from the pictures a run kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from controller.base.errors import ControllerError
from controller.face.face import Recorder
from surface.view.pictures.clip import write_clip
from surface.view.pictures.sheet import compose, write_png

_MOMENTS = 12
_COLUMNS = 4


def write_pictures(recorder: Recorder, folder: Path) -> list[str]:
    """Write ``sheet.png`` and ``face.webp`` into ``folder``; returns their paths, none without pictures.

    Raises
    ------
    ControllerError, ViewError
        when the folder cannot be made, or a picture cannot be written.
    """
    if not recorder.frames:
        return []
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        hint = "choose another folder for the pictures"
        raise ControllerError(f"{folder}: cannot be made: {error.strerror}", hint=hint) from error
    chosen = np.unique(np.linspace(0, len(recorder.frames) - 1, _MOMENTS).round().astype(int))
    labels = [f"{recorder.times_s[i]:.1f} s" for i in chosen]
    sheet, clip = folder / "sheet.png", folder / "face.webp"
    write_png(compose([recorder.frames[i] for i in chosen], labels, columns=_COLUMNS), sheet)
    write_clip(recorder.frames, clip, fps=recorder.clip_hz)
    return [str(sheet), str(clip)]
