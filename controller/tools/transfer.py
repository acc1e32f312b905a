"""``omote fit --expressions-from``: transfers the expressions of a head to a mesh without shapes, or with too few."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from controller.base.errors import ConfigError
from controller.base.paths import find_config
from surface.base.progress import Progress
from surface.fit.api import fit_head
from surface.fit.filling.api import Filling
from surface.fit.filling.api import own_shapes as shapes_in
from surface.fit.points.report import FitReport
from surface.fit.source.load import LoadOptions
from surface.fit.transfer.api import transfer_head


def check_transfer(
    source: str | None, landmarks: Path | None, others: Mapping[str, object], *, own_shapes: bool = True
) -> None:  # fmt: skip
    """Check options of ``omote fit``. ``others`` : options that cannot be used with a transfer, by name.

    Raises ConfigError: options exclude each other.
    """
    if source is None and landmarks is not None:
        raise ConfigError("--landmarks: only a transfer of expressions uses them", hint="--expressions-from ict")
    if source is None and not own_shapes:
        raise ConfigError("--no-own-shapes: no head is named that gives others", hint="--expressions-from ict")
    for option, value in others.items():
        if source is not None and value:
            raise ConfigError(f"{option}: cannot be used with --expressions-from", hint="leave one of the two out")


@dataclass(frozen=True)
class Source:
    """Where expressions come from.

    head : a name or a folder. landmarks : file of places on the mesh; None: they are found.
    own_shapes : a mesh that has shapes keeps them, and gets only those that it lacks.
    """

    head: str
    landmarks: Path | None = None
    own_shapes: bool = True


def transfer(
    mesh: Path, source: Source, out: Path, name: str, options: LoadOptions, progress: Progress,
    report: Path | None = None, force: bool = False,
) -> FitReport:  # fmt: skip
    """Write a head in the form of a mesh with the expressions of another head.

    Raises ConfigError: no such head, or options for the shapes of a mesh that has none; and what
    :func:`surface.fit.transfer.api.transfer_head` and :func:`surface.fit.api.fit_head` raise.
    """
    head = find_config("heads", source.head)
    if source.own_shapes and shapes_in(mesh, options):
        return fit_head(
            mesh, out, name=name, progress=progress, options=options, report_dir=report, force=force,
            filling=Filling(head, source.landmarks),
        )  # fmt: skip
    for option, value in {"--shapes": options.shapes, "--names": options.names}.items():
        if value:
            raise ConfigError(f"{option}: all shapes come from {source.head}", hint="leave it out, and --no-own-shapes")
    made = transfer_head(
        mesh, head, out, name=name, landmarks=source.landmarks, options=options, progress=progress, report_dir=report,
        force=force,
    )  # fmt: skip
    return made.fit
