"""The appearance of the face (look) that the user chose."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Look:
    """The choices. person : a name or a file, empty for nobody. head : a folder; the stage's own without."""

    theme: str
    quality: str
    person: str
    head: Path | None = None
