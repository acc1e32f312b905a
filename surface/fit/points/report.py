"""Measure the errors of a fit, per part and per shape; and the record that a fit returns."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from surface.base.arrays import Bools, Floats
from surface.fit.points.refine import Fitted
from surface.fit.source.chart import Chart
from surface.head.model.accessories import Accessory
from surface.head.model.data import HeadData
from surface.head.model.texture import HeadTexture

MOST_NAMES = 4  # of one kind that a line names
NEUTRAL = "neutral"
REPORTED_MM = 0.05  # moves by contacts below this are left out of the report
RMS_MM, P99_MM, SHAPES_MM = 0.25, 0.8, 0.08  # bounds for a face on a head of usual size
FINE, MOST, ALL = "where the mesh has the detail", 0.5, 0.99  # said of at least so much of a face, and not of all of it


@dataclass(frozen=True)
class Errors:
    """Distances between samples of the mesh and the surface at the same (u, v), mm; NaN where there are no samples."""

    rms: float
    p99: float
    max: float

    @property
    def measured(self) -> bool:
        """Were there any samples?"""
        return not math.isnan(self.max)

    def figures(self) -> list[str]:
        """RMS, 99 % and greatest in words; dashes where nothing was measured."""
        return [f"{value:.3f}" if self.measured else "-" for value in (self.rms, self.p99, self.max)]


NOT_MEASURED = Errors(math.nan, math.nan, math.nan)


@dataclass(frozen=True)
class PartReport:
    """One part: its control points, the errors of neutral and of every shape it has.

    Samples inside folds (nostrils, ear canals) are held only loosely and not counted; ``folded`` is their number.
    detailed : errors of neutral where the mesh itself is nearly as smooth as the surface, which is at a ``share`` of
        the samples; None where that was not asked for.
    """

    name: str
    points: int
    samples: int
    folded: int
    neutral: Errors
    shapes: dict[str, Errors]
    detailed: Errors | None = None
    share: float = 1.0

    @property
    def mean_shape_rms(self) -> float:
        """Mean over shapes of their RMS, mm; 0 without shapes, NaN where none could be measured."""
        return float(np.mean([e.rms for e in self.shapes.values()])) if self.shapes else 0.0


@dataclass(frozen=True)
class Spot:
    """The greatest error: how far, mm, in which shape, of which part, where; from the surface to the mesh or back."""

    mm: float
    shape: str
    part: str
    place: str
    to_mesh: bool

    def __str__(self) -> str:
        way = "surface to mesh" if self.to_mesh else "mesh to surface"
        return f"{self.mm:.2f} mm: {self.shape_in_words}, {self.place} ({self.part}, {way})"

    @property
    def at_most(self) -> str:
        """How far at most, in which shape and where."""
        return f"{self.mm:.2f} mm at most: {self.shape_in_words}, {self.place} ({self.part})"

    @property
    def shape_in_words(self) -> str:
        """The shape as a report names it."""
        return "the neutral face" if self.shape == NEUTRAL else f"shape {self.shape}"


@dataclass(frozen=True)
class Both:
    """Errors of one part in one shape: of its surface from the mesh, of the mesh from its surface, both outside folds;
    and of both inside folds."""

    to_mesh: Errors
    to_surface: Errors
    folds: Errors


@dataclass(frozen=True)
class Turned:
    """Surface that faces the other way than the mesh: its area, mm², and places (k, 2) in (u, v)."""

    mm2: float
    uv: Floats


@dataclass(frozen=True)
class DenseErrors:
    """Errors by part, then by shape, :data:`NEUTRAL` first; the greatest of all; and what was not measured.

    worst, worst_fold : the greatest outside and inside folds, as nostrils, which a fit holds only loosely.
    added : parts of the head that the mesh does not have. left_out : pieces of the mesh that the head does not have.
    samples : measured in every shape, both ways.
    sticking : by part and shape, (k, 2) in (u, v): vertices of the surface that are further from the mesh than a limit.
    turned : by part and shape, the area that is inside out.
    corrected : shapes that correctives of the head, and rules of its tongue, change on purpose; they were measured
        without these.
    apart : the greatest outside folds without contacts, which move lips, lids and tongue on purpose where the mesh's
        pass through each other or an eyeball.
    parted, sealed : the vertices that contacts move furthest on purpose: those that they keep out of each other or of
        an eyeball, and those of lips that they keep together.
    otherwise : the vertex that correctives and rules of the tongue move furthest in a shape alone.
    stiff : the vertex of the mesh that its own shapes move furthest from where a part that follows skull or jaw as a
        whole has it; such a part is measured without that.
    """

    parts: dict[str, dict[str, Both]]
    worst: Spot | None
    worst_fold: Spot | None
    added: tuple[str, ...]
    left_out: tuple[str, ...]
    samples: int
    sticking: dict[tuple[str, str], Floats] = field(default_factory=dict)
    turned: dict[tuple[str, str], Turned] = field(default_factory=dict)
    corrected: tuple[str, ...] = ()
    apart: Spot | None = None
    parted: Spot | None = None
    sealed: Spot | None = None
    otherwise: Spot | None = None
    stiff: Spot | None = None

    @property
    def greatest(self) -> Spot | None:
        """The greatest error of what was fitted: without contacts, where these move the head away from its mesh."""
        return self.apart if self.worst and self.apart and self.apart.mm < self.worst.mm else self.worst

    def lines(self) -> list[str]:
        """In words: the greatest errors, what the mesh does not have, and what was left out of it."""
        out = [f"greatest error {self.greatest}"] if self.greatest else []
        if self.greatest is not self.worst:
            out.append(
                f"with contacts, which move lips, lids and tongue out of each other, away from the mesh: {self.worst}"
            )
        for what, spot in (("what would pass through itself", self.parted), ("lips that stay together", self.sealed)):
            if spot and spot.mm >= REPORTED_MM:
                out.append(f"contacts move {what} on purpose by {spot.at_most}")
        if self.worst_fold:
            out.append(f"in folds (nostrils, ear canals, corners), which are held only loosely: {self.worst_fold}")
        if self.corrected:
            named = ", ".join(self.corrected)
            out.append(f"changed on purpose by correctives and the tongue's rules, and measured without them: {named}")
            out += [f"they move a point by {self.otherwise.at_most}"] if self.otherwise else []
        if self.stiff and self.stiff.mm >= REPORTED_MM:
            why = "follow skull or jaw as a whole, on purpose, and were measured against the mesh moved so"
            out.append(f"parts {why}: its own shapes move it otherwise by {self.stiff.at_most}")
        out += [f"not in the mesh, so not measured: {', '.join(self.added)}"] if self.added else []
        return out + (
            [f"faces of the mesh that no fitted part holds: {', '.join(self.left_out)}"] if self.left_out else []
        )


@dataclass(frozen=True)
class Localised:
    """How much less of a head its shapes move, because skin that they would hardly move stays.

    before, after : displacements of control points, over all shapes. off_mm : how far skin moves otherwise by that at
        most, in which ``shape`` of which ``part``; "" where nothing does. whole : shapes that would have been off by
        more than is allowed, and stay as they are, by part.
    """

    before: int
    after: int
    off_mm: float = 0.0
    shape: str = ""
    part: str = ""
    whole: dict[str, list[str]] = field(default_factory=dict)

    def __str__(self) -> str:
        left = f"{self.before - self.after} of {self.before} displacements of control points are left out"
        where = f", which moves skin otherwise by {self.off_mm:.2f} mm at most: shape {self.shape} ({self.part})"
        kept = "; ".join(f"{', '.join(names)} ({part})" for part, names in self.whole.items())
        text = f"skin that a shape hardly moves stays: {left}{where if self.shape else ''}"
        return f"{text}; kept whole: {kept}" if kept else text


@dataclass(frozen=True)
class FitReport:
    """The whole head.

    parameters : ARKit's names that the head has shapes for; missing : those it has none for.
    left_out : shapes of the mesh that mean none of them; notes : what was guessed or left out, in words.
    scale : size of the head relative to the one that the bounds were set for.
    shapes : for each parameter the mesh's shapes that it was made of; empty : shapes that move nothing; presets :
        vowels, visemes and moods that are understood, and made from parameters instead.
    pieces : the mesh's objects and what kind each is, left out or not.
    dense : errors of the posed head by true distances, both ways.
    faults : what a head is refused for, in words; none of a usable one.
    filled : parameters that the mesh lacks, with the name of the head that they come from.
    """

    name: str
    parts: list[PartReport]
    parameters: list[str]
    missing: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    notes: list[str] = field(default_factory=list)
    scale: float = 1.0
    shapes: dict[str, list[str]] = field(default_factory=dict)
    empty: tuple[str, ...] = ()
    presets: tuple[str, ...] = ()
    pieces: dict[str, str] = field(default_factory=dict)
    dense: DenseErrors | None = None
    faults: tuple[str, ...] = ()
    filled: dict[str, str] = field(default_factory=dict)
    localised: Localised | None = None

    @property
    def points(self) -> int:
        """Control points of all fitted parts."""
        return sum(p.points for p in self.parts)


@dataclass(frozen=True)
class FittedPart:
    """One fitted chart of a head; ``targets`` (m, 3) are the mesh's positions at the chart's samples."""

    name: str
    chart: Chart
    fitted: Fitted
    targets: Floats


@dataclass(frozen=True)
class FitResult:
    """A fitted head: its data, the report, and the charts it was fitted in.

    errors : by part, (m,) mm from each vertex at rest to the mesh; NaN where it has none.
    accessories : meshes that it wears as they are. texture : of its skin; None without one.
    """

    head: HeadData
    report: FitReport
    parts: list[FittedPart]
    errors: dict[str, Floats] = field(default_factory=dict)
    accessories: tuple[Accessory, ...] = ()
    texture: HeadTexture | None = None


def face_bounds(report: FitReport) -> str:
    """Errors of the face, which is the first part, and their bounds, which grow with the head.

    Where flat faces of the mesh are further from a smooth surface than the bound itself, the mesh has no detail that a
    fit could follow: both figures are reported, and errors may be beyond the bounds there.
    """
    face = report.parts[0]
    if not face.neutral.measured:
        return f"{face.name}: not measured: there are no samples of it"
    own = _bounded(report, face.neutral)
    own += [("shapes", face.mean_shape_rms, SHAPES_MM * report.scale)] if face.shapes else []
    fine = _bounded(report, face.detailed) + own[2:] if face.detailed and face.share >= MOST else own
    verdict = (
        "within the bounds" if _kept(own) else f"within the bounds {FINE}," if _kept(fine) else "beyond the bounds"
    )
    text = f"{face.name}: {verdict} for its size ({report.scale:.2f}): {_said(own)}"
    return text if fine is own or face.share > ALL else f"{text}; {FINE} ({face.share:.0%} of it) {_said(fine[:2])}"


def _bounded(report: FitReport, errors: Errors) -> list[tuple[str, float, float]]:
    """Names of errors, the errors and their bounds, mm."""
    return [("RMS", errors.rms, RMS_MM * report.scale), ("99 %", errors.p99, P99_MM * report.scale)]


def _kept(figures: list[tuple[str, float, float]]) -> bool:
    return all(got <= most for _, got, most in figures)


def _said(figures: list[tuple[str, float, float]]) -> str:
    return ", ".join(f"{name} {got:.3f} of {most:.3f} mm" for name, got, most in figures)


def kinds_line(report: FitReport) -> str:
    """The mesh's objects by their kinds, in words; "" where there is no more than one."""
    by_kind: dict[str, list[str]] = {}
    for name, kind in report.pieces.items():
        by_kind.setdefault(kind, []).append(name)
    parts = [
        f"{kind} ({', '.join(names[:MOST_NAMES])}{', ...' * (len(names) > MOST_NAMES)})"
        for kind, names in by_kind.items()
    ]
    return f"pieces: {'; '.join(parts)}" if len(report.pieces) > 1 else ""


def measure(
    name: str, chart: Chart, fitted: Fitted, names: tuple[str, ...], fine: Bools | None = None
) -> PartReport:  # fmt: skip
    """Errors of a fitted chart over all samples outside folds, and over those that are ``fine`` (m,) if given."""
    counted = ~chart.folded
    shapes = {n: errors_of(e[counted]) for n, e in zip(names, fitted.shape_error, strict=False)}
    samples = int(counted.sum())
    own = counted if fine is None else counted & fine
    detailed = None if fine is None else errors_of(fitted.error[own])
    return PartReport(
        name, len(fitted.net), samples, len(counted) - samples, errors_of(fitted.error[counted]), shapes,
        detailed, float(own.sum()) / max(samples, 1),
    )  # fmt: skip


def plain(value: Any) -> Any:
    """Tables and lists with None for NaN, which JSON does not have."""
    if isinstance(value, dict):
        return {key: plain(v) for key, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return None if isinstance(value, float) and math.isnan(value) else value


def errors_of(distance: Floats) -> Errors:
    """Figures of distances (m,), mm; :data:`NOT_MEASURED` of none, for 0 would be a perfect fit."""
    if not len(distance):
        return NOT_MEASURED
    return Errors(float(np.sqrt((distance**2).mean())), float(np.percentile(distance, 99)), float(distance.max()))
