"""How long the picture's inverse takes: tracked points to parameters, and dragged points to control points.

Run ``python benchmarks/dragging.py [--points N]``. Times are from one run on one machine.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from rich.console import Console

from controller.base.parameters import PARAMETERS as P
from controller.base.paths import find_config
from controller.robot.anchors import head_order, sample_skin, skin_points
from controller.stage.inverse import PointSolver, SculptSolver
from controller.stage.pulling import Pin, PullSolver, lip_pairs
from surface.head import Head

FRAMES = 400
MOVES = ("jawOpen", "mouthSmileLeft", "mouthSmileRight", "browInnerUp", "eyeBlinkLeft", "mouthPucker")


PULLS = {
    "left corner of the mouth up": ((28.6, -34.0, 102.0), (0.0, 8.0)),
    "right corner of the mouth up": ((-28.6, -34.0, 102.0), (0.0, 8.0)),
    "left corner of the mouth down": ((28.6, -34.0, 102.0), (0.0, -6.0)),
    "right corner of the mouth down": ((-28.6, -34.0, 102.0), (0.0, -6.0)),
    "brow up": ((25.0, 53.0, 103.0), (0.0, 6.0)),
    "cheek up": ((46.0, -17.0, 91.0), (0.0, 4.0)),
    "chin down": ((4.0, -71.0, 108.0), (0.0, -12.0)),
    "upper lid down": ((32.0, 40.0, 97.0), (0.0, -6.0)),
}
"""Points of the skin (mm) and how far they are pulled (mm, as seen from the front)."""
STEPS = 20


def measure_pulls(console: Console, head: Head) -> None:
    """Print how far each pulled point is from the mouse at the end, and how long a solve takes on the way."""
    skin, lips = sample_skin(head, "face", skin_points(head, "face", 900, 11)), lip_pairs(head, "face")
    order = head_order(head.parameters, P)
    for name, (at, by) in PULLS.items():
        point = int(np.argmin(np.linalg.norm(skin.rest - at, axis=1)))
        solver, took = PullSolver(skin, lips, order, P, P.neutral()), []
        for share in np.linspace(1 / STEPS, 1.0, STEPS):
            goal = skin.rest[point] + share * np.array([*by, 0.0])
            began = time.perf_counter()
            solver.solve([Pin(point, goal, np.array([0.0, 0.0, 1.0]))])
            took.append(1e3 * (time.perf_counter() - began))
        console.print(
            f"{name}: {solver.missed_mm:.2f} mm away, median {np.median(took):.1f} ms, most {max(took[1:]):.1f} ms"
        )


def main() -> None:
    """Print median and p99 of solves that follow a moving face, and of cold ones."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=68, help="points of the skin that are tracked")
    count, console = parser.parse_args().points, Console(highlight=False)
    head = Head.load(find_config("heads", "ict"))
    skin = sample_skin(head, "face", skin_points(head, "face", count, 3))
    dragger = PointSolver(skin, head_order(head.parameters, P), P)
    at = [head.parameters.index(name) for name in MOVES]
    rng = np.random.default_rng(0)
    took, missed = np.zeros(FRAMES), np.zeros(FRAMES)
    for i in range(FRAMES):
        shapes = np.zeros(dragger.skin.moves.shape[2])
        shapes[at] = 0.5 + 0.5 * np.sin(i / 15 + np.arange(len(at)))
        places = dragger.skin.rest + dragger.skin.displacement(shapes) + rng.normal(0, 0.1, dragger.skin.rest.shape)
        began = time.perf_counter_ns()
        values = dragger.solve(places)
        took[i] = (time.perf_counter_ns() - began) / 1e6
        missed[i] = np.abs(values[[P.index(name) for name in MOVES]] - shapes[at]).max()
    median, late = np.percentile(took[5:], [50, 99])
    console.print(f"{count} tracked points, 52 parameters: median {median:.2f} ms, p99 {late:.2f} ms (reach 2 ms)")
    console.print(f"worst value off by {missed.max():.2f}")
    measure_pulls(console, head)
    reshaper = SculptSolver(head)
    uv = skin_points(head, "face", 5, 8)
    began = time.perf_counter_ns()
    shape = reshaper.solve(uv, rng.normal(0, 3, (5, 3)))
    console.print(
        f"5 dragged points: {len(shape.ids)} control points in {(time.perf_counter_ns() - began) / 1e6:.1f} ms"
    )


if __name__ == "__main__":
    main()
