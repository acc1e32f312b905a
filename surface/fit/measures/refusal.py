"""Write a head, or, where it does not follow its mesh, put it beside its place and refuse it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from surface.base.arrays import Floats
from surface.base.errors import FitError
from surface.fit.measures.saving import save_head
from surface.head.model.accessories import Accessory
from surface.head.model.data import HeadData
from surface.head.model.texture import HeadTexture

REFUSED = "-refused"  # what is put behind the name of a folder
HINT = "correct the mesh there or leave out what hides it (--without NAME)"


def refused_folder(out_dir: str | Path) -> Path:
    """Where a head goes that is refused."""
    folder = Path(out_dir).resolve()
    return folder.with_name(folder.name + REFUSED)


def save_or_refuse(
    out_dir: str | Path, head: HeadData, faults: Sequence[str], errors: Mapping[str, Floats],
    accessories: Sequence[Accessory] = (), texture: HeadTexture | None = None, *, force: bool = False, hint: str = HINT,
) -> None:  # fmt: skip
    """Write a head to ``out_dir``; one with faults to the folder :func:`refused_folder` instead, unless forced.

    errors, accessories, texture : as for :func:`surface.fit.measures.saving.save_head`, which says in which order files
        change.
    hint : what to do about faults, in words.

    Raises FitError: the head has faults; what is in ``out_dir`` stays as it was. HeadFileError: a folder cannot be
    written to.
    """
    refused = bool(faults) and not force
    folder = refused_folder(out_dir) if refused else Path(out_dir)
    save_head(folder, head, errors, accessories, texture)
    if refused:
        what = f"the head is refused: {'; '.join(faults)}; it was written to {folder} instead"
        look = f"look at it (omote render --head {folder} -o out.png), {hint}"
        raise FitError(what, hint=f"{look}, or use --force to write it nevertheless")
