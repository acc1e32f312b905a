"""Write the files of a report into a folder, all of them or none."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from surface.base.errors import FitError


@contextmanager
def report_folder(folder: Path) -> Iterator[Path]:
    """An empty folder for new files, which move to ``folder`` at the end of the context.

    An error in the context leaves ``folder`` as it was. Raises FitError: files or folder cannot be written.
    """
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}-") as made:
            new = Path(made)
            yield new
            folder.mkdir(exist_ok=True)
            for file in new.iterdir():
                shutil.move(file, folder / file.name)
    except OSError as e:
        raise FitError(f"{folder}: the report cannot be written ({e})", hint="choose another --report folder") from e
