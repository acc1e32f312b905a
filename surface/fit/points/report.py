"""How well a fit fits: figures per part and per shape."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from surface.base.arrays import Floats
from surface.fit.points.refine import Fitted
from surface.fit.source.chart import Chart

# what a face on a head of usual size shall keep to, mm
RMS_MM, P99_MM, SHAPES_MM = 0.25, 0.8, 0.08


@dataclass(frozen=True)
class Errors:
    """Distances between samples of the mesh and the surface at the same (u, v), mm."""

    rms: float
    p99: float
    max: float


@dataclass(frozen=True)
class PartReport:
    """One part: its control points, the errors of neutral and of every shape it has.

    Samples inside folds (nostrils, ear canals) are held only loosely and not counted; ``folded`` says how many.
    """

    name: str
    points: int
    samples: int
    folded: int
    neutral: Errors
    shapes: dict[str, Errors]

    @property
    def mean_shape_rms(self) -> float:
        """Mean over shapes of their RMS, mm; 0 without shapes."""
        return float(np.mean([e.rms for e in self.shapes.values()])) if self.shapes else 0.0


@dataclass(frozen=True)
class FitReport:
    """The whole head.

    Attributes
    ----------
    parameters : ARKit's names that the head has shapes for; missing : those it has none for.
    left_out : shapes of the mesh that mean none of them; notes : what was guessed or left out, in words.
    scale : how large the head is beside the one that the bounds were set for.
    """

    name: str
    parts: list[PartReport]
    parameters: list[str]
    missing: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    notes: list[str] = field(default_factory=list)
    scale: float = 1.0

    @property
    def points(self) -> int:
        """Control points of all fitted parts."""
        return sum(p.points for p in self.parts)


def face_bounds(report: FitReport) -> str:
    """The face, which is the first part, beside its bounds; they grow with the head."""
    face = report.parts[0]
    pairs = [("RMS", face.neutral.rms, RMS_MM), ("99 %", face.neutral.p99, P99_MM)]
    pairs += [("shapes", face.mean_shape_rms, SHAPES_MM)] if face.shapes else []
    said = ", ".join(f"{name} {got:.3f} of {most * report.scale:.3f} mm" for name, got, most in pairs)
    kept = all(got <= most * report.scale for _, got, most in pairs)
    return f"{face.name}: {'within' if kept else 'beyond'} the bounds for its size ({report.scale:.2f}): {said}"


def measure(name: str, chart: Chart, fitted: Fitted, names: tuple[str, ...]) -> PartReport:
    """Errors of a fitted chart over all samples outside folds."""
    counted = ~chart.folded
    shapes = {n: _errors(e[counted]) for n, e in zip(names, fitted.shape_error, strict=False)}
    return PartReport(
        name, len(fitted.net), int(counted.sum()), int((~counted).sum()), _errors(fitted.error[counted]), shapes
    )


def _errors(distance: Floats) -> Errors:
    if not len(distance):
        return Errors(0.0, 0.0, 0.0)
    return Errors(float(np.sqrt((distance**2).mean())), float(np.percentile(distance, 99)), float(distance.max()))
