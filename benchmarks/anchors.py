"""Anchor mapping against a naive table: how much of the emotions' motion each leaves over on the 24-servo head.

Run ``python benchmarks/anchors.py``. Both mappings drive the same model of the servo head's skin; what is left is
measured at points of the skin that the solve never saw: close to each anchor along its pull, and everywhere in space.
The naive table gives each servo the one parameter it is named after, 1 for its whole travel.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from rich.console import Console
from rich.table import Table

from controller.anchors import AnchorMap, Rows, anchored, first, load_anchors, point_regions, sample_skin, servo_field
from controller.expression import Vocabulary
from controller.parameters import PARAMETERS, Floats
from controller.paths import find_config
from controller.robot import ChannelSettings, load_robot
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


def rms(values: Floats) -> float:
    """Root mean square."""
    return float(np.sqrt((values**2).mean()))


class Unseen:
    """The same servos at points around the anchors that the solve did not have."""

    def __init__(self, head: Head, solved: AnchorMap, channels: list[ChannelSettings]) -> None:
        anchors = [channel.anchor for channel in channels if channel.anchor is not None]
        k = len(anchors)
        uv = head.part(solved.skin.part).mesh.uv.astype(np.float64)
        used = {tuple(point) for point in solved.skin.uv}
        fresh = np.array([point for point in uv if tuple(point) not in used])
        self.skin = sample_skin(head, solved.skin.part, np.concatenate([solved.skin.uv[:k], fresh]))
        own = first(self.skin, k)
        self.field = servo_field(anchors, own, self.skin).reshape(-1, 3, k)
        around = Rows.around(anchors, own, self.skin, NEAR_MM)
        new = around.point >= k
        self.rows = Rows(around.point[new], around.pull[new], around.way[new])

    def left(self, shapes: Floats, pulls: Floats) -> Floats:
        """(m, 3) mm that the servos stay behind."""
        return self.skin.displacement(shapes) - self.field @ pulls


def main() -> None:
    """Print the residuals."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.parse_args()
    head = Head.load(find_config("heads", "ict"))
    robot = load_robot(find_config("robots", "head24-anchors"), PARAMETERS)
    solved = load_anchors(robot, head, PARAMETERS)
    if solved is None:
        raise SystemExit("the robot has no anchors")
    channels = anchored(robot)
    show(solved, Unseen(head, solved, channels), channels)


def show(solved: AnchorMap, unseen: Unseen, channels: list[ChannelSettings]) -> None:
    """Tables by emotion and by region."""
    vocabulary, console = Vocabulary.load(PARAMETERS), Console()
    along, whole = [], []
    for name in EMOTIONS:
        values = vocabulary[name].weights
        shapes = solved.shapes(values)
        left = [
            unseen.left(shapes, p)
            for p in (np.zeros(len(channels)), naive_pulls(channels, values), solved.pulls(values))
        ]
        along.append([unseen.rows.along(points) for points in left])
        whole.append([np.linalg.norm(points, axis=1) for points in left])
    title = f"along the pulls, {len(unseen.rows.point)} points not in the solve"
    table = Table("emotion", "moves", "naive", "anchors", "rms of naive", "squares of naive", title=title)
    for name, row in [
        *zip(EMOTIONS, along, strict=True),
        ("all", [np.concatenate(x) for x in zip(*along, strict=True)]),
    ]:
        a, b, c = (rms(x) for x in row)
        table.add_row(name, f"{a:.2f} mm", f"{b:.2f} mm", f"{c:.2f} mm", f"{c / b:.0%}", f"{c * c / b / b:.0%}")
    console.print(table)
    regions = point_regions(unseen.skin, PARAMETERS)
    table = Table("region", "moves", "naive", "anchors", title="in space, the whole skin")
    for region in sorted(set(regions)):
        numbers = [rms(np.array(x)[:, regions == region]) for x in zip(*whole, strict=True)]
        table.add_row(region, *(f"{x:.2f} mm" for x in numbers))
    console.print(table)
    values, began = vocabulary["surprise"].weights.copy(), time.perf_counter()
    for i in range(2000):
        solved.pulls(values * (0.5 + 0.5 * np.sin(i / 20)))
    console.print(f"one solve: {(time.perf_counter() - began) / 2:.3f} ms")


if __name__ == "__main__":
    main()
