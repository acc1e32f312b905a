"""Write a head and what lies beside it in the place of another one, so that neither gets what is the other's."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from surface.base.arrays import Floats
from surface.base.errors import HeadFileError
from surface.head import Head
from surface.head.model.accessories import FILE, Accessory, write_accessories
from surface.head.model.data import HeadData
from surface.head.model.file import save_data
from surface.head.model.texture import FILE as TEXTURE
from surface.head.model.texture import HeadTexture, write_texture
from surface.head.posing.fit_error import FIT_ERROR, write_fit_error

OWN = (FIT_ERROR, FILE, TEXTURE)  # files that belong to one head alone, and do not say to which
ASIDE = ".old"  # what is put behind their names while another head is written


def save_head(
    folder: str | Path, head: HeadData, errors: Mapping[str, Floats] | None = None,
    accessories: Sequence[Accessory] = (), texture: HeadTexture | None = None,
) -> None:  # fmt: skip
    """Write a head to a folder, in the place of the one that may be there.

    errors : by part, (m,) mm from each vertex at rest to the mesh, NaN where there is none; kept beside the head, as
    ``accessories`` and the ``texture`` of its skin are. None: the head was fitted to no mesh.

    First the files :data:`OWN` of the head before are put aside, then head.toml and head.npz replace the old ones, then
    what was put aside is removed, and last the new head's own files are written. So the old head gets everything back
    where the new one cannot be written; and whoever is interrupted by force finds no hair of the old head on the new
    one, and the old head's hair in ``accessories.npz.old``.

    Raises HeadFileError: the folder cannot be written to, or the disk is full.
    """
    with _put_aside([Path(folder) / name for name in OWN]):
        save_data(folder, head)
    if errors is not None:
        write_fit_error(folder, errors, Head(head).parts)
    write_accessories(folder, accessories)
    write_texture(folder, texture)


@contextmanager
def _put_aside(files: Sequence[Path]) -> Iterator[None]:
    """Move files away that are there; back where the block fails, else remove them. Raises HeadFileError: it cannot."""
    aside = {file: file.with_name(file.name + ASIDE) for file in files}
    moved = list[Path]()
    try:
        with _as_head_errors(files[0].parent):
            for file in filter(Path.exists, files):
                file.replace(aside[file])
                moved.append(file)
        yield
    except BaseException:  # an interruption, too
        for file in moved:
            aside[file].replace(file)
        raise
    with _as_head_errors(files[0].parent):
        for file in aside.values():
            file.unlink(missing_ok=True)


@contextmanager
def _as_head_errors(folder: Path) -> Iterator[None]:
    """Raise HeadFileError for an error of the system."""
    try:
        yield
    except OSError as error:
        hint = "choose another folder, or remove what is in the way"
        raise HeadFileError(f"{folder}: the head there cannot be replaced ({error})", hint=hint) from error
