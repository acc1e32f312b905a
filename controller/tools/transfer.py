"""``omote fit --expressions-from``: transfers the expressions of a head to a mesh without shapes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from controller.base.errors import ConfigError
from controller.base.paths import find_config
from surface.base.progress import Progress
from surface.fit.points.report import FitReport
from surface.fit.source.load import LoadOptions
from surface.fit.transfer.api import transfer_head


def check_transfer(source: str | None, landmarks: Path | None, others: Mapping[str, object]) -> None:
    """Check options of ``omote fit``. ``others`` : options that cannot be used with a transfer, by name.

    Raises ConfigError: options exclude each other.
    """
    if source is None and landmarks is not None:
        raise ConfigError("--landmarks: only a transfer of expressions uses them", hint="--expressions-from ict")
    for option, value in others.items():
        if source is not None and value:
            raise ConfigError(f"{option}: cannot be used with --expressions-from", hint="leave one of the two out")


def transfer(
    mesh: Path, source: str, out: Path, name: str, landmarks: Path | None, options: LoadOptions, progress: Progress,
    report: Path | None = None, force: bool = False,
) -> FitReport:  # fmt: skip
    """Write a head in the form of a mesh with the expressions of the head ``source``, a name or a folder.

    Raises ConfigError: no such head; and what :func:`surface.fit.transfer.api.transfer_head` raises.
    """
    head = find_config("heads", source)
    made = transfer_head(
        mesh, head, out, name=name, landmarks=landmarks, options=options, progress=progress, report_dir=report,
        force=force,
    )  # fmt: skip
    return made.fit
