"""Anchor mapping against a naive table: how much of the emotions' motion each leaves over on the 24-servo head.

Run ``python benchmarks/anchors.py``. Both mappings drive the same model of the servo head's skin; what is left is
measured at points of the skin that the solve never saw. An anchor is a point with a direction, so the residual at
anchors that were not used is what is missing along each servo's pull at other points close to it. Two harder measures
stand beside it: the same points in all directions, and the whole skin. "best" is the least that any pulls within the
servos' travel leave at the very points of the measure, "free" the least with endless travel: no mapping can do better
on this head. The naive table gives each servo the one parameter it is named after, 1 for its whole travel.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.optimize import lsq_linear

from controller.base.parameters import PARAMETERS, Floats
from controller.base.paths import find_config
from controller.robot.anchors import AnchorSolver, PullRows, load_anchors, pull_range_mm, sample_skin, servo_field
from controller.robot.robot import load_robot
from controller.robot.settings import ChannelSettings
from controller.vocabulary.vocabulary import Vocabulary
from surface.head import Head

NAIVE = {
    "jawOpen": "jawOpen",
    "jawSide": "jawLeft",
    "upperLid": "eyeBlink",
    "lowerLid": "eyeSquint",
    "browInner": "browInnerUp",
    "browOuter": "browOuterUp",
    "lipCornerUp": "mouthSmile",
    "lipCornerOut": "mouthStretch",
    "upperLip": "mouthUpperUpLeft",
    "lowerLip": "mouthLowerDownLeft",
    "noseCheeks": "noseSneerLeft",
}
EMOTIONS = ("happiness", "sadness", "surprise", "fear", "anger", "disgust", "contempt")
NEAR_MM = 6.0


def naive_pulls(channels: list[ChannelSettings], values: Floats) -> Floats:
    """(k,) mm: each servo follows one parameter."""
    out = np.zeros(len(channels))
    for j, channel in enumerate(channels):
        side = next((s for s in ("Left", "Right") if channel.name.endswith(s)), "")
        name = NAIVE[channel.name.removesuffix(side)]
        name = name if name in PARAMETERS.names else name + side
        out[j] = values[PARAMETERS.index(name)] * channel.map.at[-1]
    return out


class Unseen:
    """The same servos at points around the anchors that the solve did not have."""

    def __init__(self, head: Head, solved: AnchorSolver, channels: list[ChannelSettings]) -> None:
        anchors = [channel.anchor for channel in channels if channel.anchor is not None]
        k = len(anchors)
        uv = head.part(solved.skin.part).mesh.uv.astype(np.float64)
        used = {tuple(point) for point in solved.skin.uv}
        fresh = np.array([point for point in uv if tuple(point) not in used])
        self.skin = sample_skin(head, solved.skin.part, np.concatenate([solved.skin.uv[:k], fresh]))
        own = self.skin.subset(slice(k))
        self.field = servo_field(anchors, own, self.skin).reshape(-1, 3, k)
        around = PullRows.near(anchors, own, self.skin, NEAR_MM)
        new = around.point >= k
        self.rows = PullRows(around.point[new], around.anchor[new], around.direction[new])

    def left(self, shapes: Floats, pulls: Floats) -> Floats:
        """(m, 3) mm that the servos stay behind."""
        return self.skin.displacement(shapes) - self.field @ pulls


@dataclass(frozen=True)
class Measure:
    """One way to measure: rows (r, k) of what each pull moves, and what picks the same of a displacement (m, 3)."""

    name: str
    field: Floats
    pick: Callable[[Floats], Floats]


def measures(unseen: Unseen) -> list[Measure]:
    """From the anchors' own sense to the whole skin."""
    near = np.unique(unseen.rows.point)
    k = unseen.field.shape[2]
    return [
        Measure(
            f"along the pulls, {len(unseen.rows.point)} anchors", unseen.rows.project(unseen.field), unseen.rows.project
        ),
        Measure(
            f"all directions, {len(near)} points there", unseen.field[near].reshape(-1, k), lambda d: d[near].ravel()
        ),
        Measure(f"all directions, {len(unseen.field)} points", unseen.field.reshape(-1, k), np.ravel),
    ]


def compare(
    measure: Measure, solved: AnchorSolver, unseen: Unseen, channels: list[ChannelSettings]
) -> dict[str, Floats]:
    """(e,) root sums of squares by mapping, one for each emotion."""
    vocabulary, ends = Vocabulary.load(PARAMETERS), np.array([pull_range_mm(channel) for channel in channels]).T
    rows: dict[str, list[float]] = {}
    for name in EMOTIONS:
        values = vocabulary[name].weights
        wanted = measure.pick(unseen.skin.displacement(solved.shape_values(values)))
        pulls = {
            "moves": np.zeros(len(channels)),
            "naive": naive_pulls(channels, values),
            "anchors": solved.pulls_mm(values),
            "best": lsq_linear(measure.field, wanted, ends).x,
            "free": np.linalg.lstsq(measure.field, wanted, rcond=None)[0],
        }
        for key, each in pulls.items():
            rows.setdefault(key, []).append(float(np.linalg.norm(wanted - measure.field @ each)))
    return {key: np.array(each) for key, each in rows.items()}


def show(measure: Measure, left: dict[str, Floats]) -> Table:
    """A row an emotion, and one for the set."""
    table = Table("emotion", *left, "anchors / naive", "of squares", "best / naive", title=measure.name)
    size = np.sqrt(len(measure.field) / (1 if "along" in measure.name else 3))
    every = {key: np.append(each, np.sqrt((each**2).mean())) for key, each in left.items()}
    for i, name in enumerate((*EMOTIONS, "all")):
        share, best = (every[key][i] / every["naive"][i] for key in ("anchors", "best"))
        table.add_row(name, *(f"{each[i] / size:.2f} mm" for each in every.values()), f"{share:.1%}", f"{share**2:.1%}",
                      f"{best:.1%}")  # fmt: skip
    return table


def main() -> None:
    """Print the residuals."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    console = Console()
    head = Head.load(find_config("heads", "ict"))
    robot = load_robot(find_config("robots", "head24-anchors"), PARAMETERS)
    solved = load_anchors(robot, head, PARAMETERS)
    if solved is None:
        raise SystemExit("the robot has no anchors")
    channels = robot.anchored_channels
    unseen = Unseen(head, solved, channels)
    for measure in measures(unseen):
        console.print(show(measure, compare(measure, solved, unseen, channels)))
    values, began = Vocabulary.load(PARAMETERS)["surprise"].weights.copy(), time.perf_counter()
    for i in range(2000):
        solved.pulls_mm(values * (0.5 + 0.5 * np.sin(i / 20)))
    console.print(f"one solve: {(time.perf_counter() - began) / 2:.3f} ms")


if __name__ == "__main__":
    main()
