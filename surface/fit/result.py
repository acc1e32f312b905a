"""What a fit gives: the head, the report, and the charts it was fitted in."""

from __future__ import annotations

from dataclasses import dataclass

from surface.base.arrays import Floats
from surface.fit.points.refine import Fitted
from surface.fit.points.report import FitReport
from surface.fit.source.chart import Chart
from surface.head.model.data import HeadData


@dataclass(frozen=True)
class FittedPart:
    """One fitted chart of a head, for reports; ``targets`` (m, 3) is where the mesh is at the chart's samples."""

    name: str
    chart: Chart
    fitted: Fitted
    targets: Floats


@dataclass(frozen=True)
class FitResult:
    """A fitted head: its data, the report, and the charts it was fitted in."""

    head: HeadData
    report: FitReport
    parts: list[FittedPart]
