"""Eq. (1) and Eq. (2) on the graphics processor: every sum of all vertices, beside what moved control points add.

Run ``python benchmarks/gpu_update.py [--head ict] [--vertices 1000000]``. The first table moves single parameters of a
head, the second a share of the control points of a bicubic sheet. Each row says which share of the entries changes and
how long one update takes both ways until the graphics processor has finished, from displaced control points to vertices
and normals in the buffer that is drawn; rows alternate between the ways. With software rendering the figures are those
of the processor. Times are from one run on one machine.
"""

from __future__ import annotations

import argparse
import time
from statistics import median
from types import SimpleNamespace
from typing import Any

import numpy as np
from gpu_differences import KeptSums
from rich.console import Console
from rich.table import Table
from scipy.interpolate import BSpline

from controller.base.paths import find_config
from surface.head import Head
from surface.head.posing.influence import Influence
from surface.view.draw.vertex_sums import VertexSums
from surface.view.pictures.offscreen import open_context

ROUNDS = 40
NAMES = ("eyeBlinkLeft", "browInnerUp", "mouthSmileLeft", "jawOpen", "headYaw", "all")
SHARES = (0.0001, 0.001, 0.01, 0.05, 0.1, 0.25, 0.5, 1.0)


class Both:
    """The same vertices both ways. sums : as :class:`surface.head.posing.influence.Influence`."""

    def __init__(self, ctx: Any, sums: Any) -> None:
        self._ctx, self._sums = ctx, sums
        self._count = len(sums.share)
        # Differences everywhere: where they are slower shall be seen.
        self.ways: dict[str, Any] = {"whole": VertexSums(ctx, sums), "difference": KeptSums(ctx, sums, share=1.0)}
        self._buffer = ctx.buffer(reserve=24 * self._count)

    def time(self, one: np.ndarray, other: np.ndarray, turn: Any) -> dict[str, float]:
        """Milliseconds of an update from one set of points (n, 3) to another, median of all rounds, by way."""
        found: dict[str, list[float]] = {way: [] for way in self.ways}
        for _ in range(ROUNDS):
            for way, own in self.ways.items():
                own.update(one, turn)
                own.write(self._buffer, 0, self._count)
                self._ctx.finish()
                begun = time.perf_counter()
                own.update(other, turn)
                own.write(self._buffer, 0, self._count)
                self._ctx.finish()
                found[way].append(1e3 * (time.perf_counter() - begun))
        return {way: median(times) for way, times in found.items()}

    def share(self, moved: np.ndarray) -> float:
        """Of the entries: those of control points that moved, (n,) bool."""
        counts = np.bincount(self._sums.ids, minlength=self._sums.points)
        return float(counts[: len(moved)][moved].sum() / counts.sum())


def table(title: str, rows: list[tuple[str, float, dict[str, float]]]) -> Table:
    """A row each: what moved, share of the entries, times."""
    out = Table("moved", "entries", "Eq. (1), ms", "Eq. (2), ms", "ratio", title=title)
    for name, share, times in rows:
        ratio = times["whole"] / times["difference"]
        out.add_row(name, f"{share:.2%}", f"{times['whole']:.3f}", f"{times['difference']:.3f}", f"{ratio:.2f}")
    return out


def head_rows(ctx: Any, head: Head) -> list[tuple[str, float, dict[str, float]]]:
    """Single parameters, and all of them, from one value to another near by."""
    both, rows = Both(ctx, Influence(head)), []
    for name in NAMES:
        poses = []
        for value in (0.3, 0.35):
            values = np.zeros(len(head.parameters))
            values[:] = value if name == "all" else 0.0
            if name != "all":
                values[list(head.parameters).index(name)] = value
            points, turn = head.place_points(values)
            poses.append((np.concatenate(points).astype(np.float32), turn))
        (one, _), (other, turn) = poses
        moved = (one != other).any(axis=1)
        rows.append((name, both.share(moved), both.time(one, other, turn)))
    return rows


def sheet(vertices: int) -> Any:
    """Sums of a bicubic B-spline sheet with about a quarter as many control points a side as vertices a side."""
    side = round(vertices**0.5)
    net = side // 4
    t = np.linspace(0.0, net - 3.0, side, endpoint=False)
    first = t.astype(int)
    reach = first[:, None] + np.arange(4)
    spline = BSpline.basis_element(np.arange(5.0))
    inside = t[:, None] + 3.0 - reach  # where each of the four splines is evaluated, 0..4
    value, slope = spline(inside), spline.derivative()(inside)
    ids = (reach[:, None, :, None] * net + reach[None, :, None, :]).reshape(side * side, 16)
    pairs = ((value, value), (slope, value), (value, slope))
    weights = np.stack([np.einsum("ia,jb->ijab", a, b).reshape(side * side, 16) for a, b in pairs], axis=2)
    return SimpleNamespace(
        points=net * net, start=16 * np.arange(side * side + 1), ids=ids.ravel(), weights=weights.reshape(-1, 3),
        share=np.ones(side * side, np.float32),
    )  # fmt: skip


def sheet_rows(ctx: Any, vertices: int) -> list[tuple[str, float, dict[str, float]]]:
    """Shares of the points, as a patch of neighbours would move."""
    sums = sheet(vertices)
    both, rows = Both(ctx, sums), []
    one = np.random.default_rng(1).normal(size=(sums.points, 3)).astype(np.float32)
    still = SimpleNamespace(vector=np.zeros(3), pivot=np.zeros(3))
    for share in SHARES:
        count = max(1, round(share * sums.points))
        other = one.copy()
        other[:count] += 0.25
        moved = np.arange(sums.points) < count
        rows.append((f"{count} points", both.share(moved), both.time(one, other, still)))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--head", default="ict")
    parser.add_argument("--vertices", type=int, default=1_000_000)
    arguments = parser.parse_args()
    console, ctx = Console(), open_context()
    console.print(ctx.info["GL_RENDERER"])
    head = Head.load(find_config("heads", arguments.head))
    console.print(table(f"head {arguments.head}", head_rows(ctx, head)))
    console.print(table(f"sheet of {arguments.vertices} vertices", sheet_rows(ctx, arguments.vertices)))


if __name__ == "__main__":
    main()
