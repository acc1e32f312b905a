"""How deep lips and lids pass through each other, and the tongue through lips and teeth, in every pair of the 52
parameters at 1.0, and in random mixtures; and how far seams gape.

Run ``python benchmarks/head_pairs.py [--head HEAD] [--worst 12] [--mixtures 500]``: some
minutes. The bound is 0.5 mm for pairs.
"""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

import numpy as np
import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from controller.base.paths import find_config
from surface.check.crossings import Crossings
from surface.head import Head
from surface.head.model.parameters import SHAPES

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "surface"))
from face_measures import Sheet, crossing, seams_gape, sides  # type: ignore[import-not-found]

TONGUE = ("tongue", "face", "teeth_upper", "teeth_lower")  # the first against each of the others
REACH_MM, LEAST_MM = 8.0, 0.1


class TongueCrossings:
    """How deep the tongue reaches into lips and teeth, or they into it: by a tree of boxes around the triangles."""

    def __init__(self, head: Head) -> None:
        head.pose(head.values({}))
        self.parts = [head.part(name) for name in TONGUE]
        first = np.cumsum([0, *(len(p.vertices) for p in self.parts)])
        triangles = np.concatenate([p.triangles + k for p, k in zip(self.parts, first, strict=False)])
        kind = np.repeat(np.arange(len(TONGUE)), [len(p.triangles) for p in self.parts])
        meets = np.zeros((len(TONGUE), len(TONGUE)), bool)
        meets[0, 1:] = meets[1:, 0] = True
        same = np.arange(first[-1])
        self.crossings = Crossings(self._vertices(), triangles.astype(np.int64), same, kind, meets)

    def _vertices(self) -> np.ndarray:
        return np.concatenate([p.vertices for p in self.parts]).astype(np.float64)

    def depths(self) -> dict[str, float]:
        """Depth in mm with each of the others, in the head's pose."""
        pairs = self.crossings.pairs(self._vertices())
        out = {}
        for k, name in enumerate(TONGUE[1:], 1):
            both = [self.crossings.depths(pairs, a, b, REACH_MM, LEAST_MM)[1] for a, b in ((0, k), (k, 0))]
            out[f"tongue, {name}"] = float(max(d.max(initial=0.0) for d in both))
        return out


def measured(
    head: Head, openings: dict[str, tuple[Sheet, Sheet]], tongue: TongueCrossings, values: np.ndarray
) -> dict[str, float]:
    """Depth in mm at every opening in one pose."""
    head.pose(values)
    return {name: crossing(*both)[0] for name, both in openings.items()} | tongue.depths()


def main(head: str = "ict", worst: int = 12, mixtures: int = 500) -> None:
    """Measure and print."""
    face = Head.load(find_config("heads", head))
    loops = face.data.parts[0].loops
    names = ("lips", "left lids", "right lids")
    lining, reach = ("cavity", "sockets", "sockets"), (14.0, 8.0, 8.0)
    openings = {n: sides(face, loops[k + 1], lining[k], reach[k]) for k, n in enumerate(names)}
    tongue = TongueCrossings(face)
    pairs = list(itertools.combinations_with_replacement(SHAPES, 2))
    found = [measured(face, openings, tongue, face.values(dict.fromkeys(p, 1.0))) for p in track(pairs, "pairs")]
    table = Table("opening", "parameters at 1.0", "mm", title=f"{len(pairs)} pairs, deepest {worst} of each opening")
    names = tuple(found[0])
    for name in names:
        for k in sorted(range(len(pairs)), key=lambda k: -found[k][name])[:worst]:
            if found[k][name] > 0:
                table.add_row(name, " + ".join(pairs[k]), f"{found[k][name]:.2f}")
    console = Console()
    console.print(table)
    rng = np.random.default_rng(11)
    deepest, gape = dict.fromkeys(names, 0.0), 0.0
    for _ in track(range(mixtures), "mixtures"):
        values = np.zeros(len(face.parameters))
        values[rng.choice(len(SHAPES), 6, replace=False)] = rng.uniform(0, 1, 6)
        deepest = {n: max(d, deepest[n]) for n, d in measured(face, openings, tongue, values).items()}
        gape = max(gape, seams_gape(face))
    said = ", ".join(f"{n} {d:.2f} mm" for n, d in deepest.items())
    console.print(f"{mixtures} mixtures of six parameters: {said}; seams between parts gape {gape:.3f} mm at most")


if __name__ == "__main__":
    typer.run(main)
