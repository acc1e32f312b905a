"""``omote fit`` of a surface file: checks the options and writes the head."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from controller.base.errors import ConfigError
from controller.base.paths import find_config
from surface.base.progress import Progress

if TYPE_CHECKING:
    from surface.fit.surfaces import SurfaceReport  # imported lazily: only surface files need it

SUFFIXES = (".3dm", ".tsm", ".xml", ".json")


def is_surface_file(path: Path) -> bool:
    """Whether a path has the suffix of a surface file."""
    return path.suffix.lower() in SUFFIXES and not path.is_dir()


def reject_surface_options(mesh: Path, given: Mapping[str, object]) -> None:
    """Raise ConfigError for an option that was given and applies only to surface files."""
    for option, value in given.items():
        if value:
            why = f"{option}: is for files of surfaces ({', '.join(SUFFIXES)}), not for {mesh}"
            raise ConfigError(why, hint="leave it out")


@dataclass(frozen=True)
class SurfaceFit:
    """The options of ``omote fit`` for a surface file; see its ``--help``."""

    path: Path
    out: Path
    name: str | None
    unit: str | None
    up: str | None
    forward: str | None
    without: tuple[str, ...]
    only: tuple[str, ...]
    groups: tuple[Path, ...]
    strict: bool
    expressions_from: str | None
    landmarks: Path | None
    report: Path | None

    def check(self, meshes_only: Mapping[str, object]) -> None:
        """Raise ConfigError for options that exclude each other. ``meshes_only`` : options of meshes, by name."""
        for option, value in meshes_only.items():
            if value:
                why = f"{option}: is for meshes; the control points of {self.path} stay as they are"
                raise ConfigError(why, hint="leave it out; --groups FILE and --expressions-from ict move surfaces")
        if self.landmarks is not None and self.expressions_from is None:
            raise ConfigError("--landmarks: only a transfer of expressions uses them", hint="--expressions-from ict")

    def run(self, progress: Progress) -> SurfaceReport:
        """Write the head, and return a report.

        Raises ConfigError: no head called ``expressions_from``; and what :func:`surface.fit.surfaces.fit_surfaces`
        raises.
        """
        from surface.fit.surfaces import SurfaceOptions, fit_surfaces  # imported lazily: only surface files need it

        source = None if self.expressions_from is None else find_config("heads", self.expressions_from)
        options = SurfaceOptions(
            self.unit, self.up, self.forward, self.without, self.only, self.strict, self.groups, source, self.landmarks
        )
        title = self.name or self.out.resolve().name
        return fit_surfaces(self.path, self.out, name=title, options=options, progress=progress, report_dir=self.report)
