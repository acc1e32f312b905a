"""How far the picture that is computed back from a servo head's positions is from the picture of what was sent.

Run ``python benchmarks/servo_mirror.py [--robot ROBOT] [--head HEAD] [--take FILE]``: seconds. For each emotion at 1.0
the robot's channels give the angles, within its limits; the mirror finds the face that these angles show.
benchmarks/action_units.toml has the landmarks; those of one side are measured on both. "unknown" is what a mirror
leaves that knows all expressions but this one, "half" the same emotion at half its weights. A recorded take, of which
every 20th frame is measured without its eyes, is a face that no expression was made for.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from controller.base.parameters import PARAMETERS, Floats
from controller.base.paths import find_config
from controller.robot.anchors import load_anchors
from controller.robot.channels import ChannelTable, build_table
from controller.robot.following import Mirror
from controller.robot.robot import load_robot
from controller.takes.reader import load_take
from controller.vocabulary.vocabulary import Vocabulary
from surface.head import Head

sys.path.insert(0, str(Path(__file__).parent))
from action_units import TABLES, Landmarks  # type: ignore[import-not-found]

EMOTIONS = ("happiness", "sadness", "surprise", "fear", "anger", "disgust")
EVERY = 20


class Skin:
    """Landmarks of a head, those of one side on both sides."""

    def __init__(self, head: Head) -> None:
        places: dict[str, dict[str, Any]] = tomllib.loads(TABLES.read_text())["landmarks"]
        other = {
            f"{name}, right": {**place, "at": [-place["at"][0], place["at"][1]]}
            for name, place in places.items()
            if place["at"][0]
        }
        self.head, self.marks = head, Landmarks(head, places | other)
        self.names = list(self.marks.rest)
        self._rest = np.array(list(self.marks.rest.values()))

    def moved(self, values: Floats) -> Floats:
        """(m, 3) mm: how far the landmarks are from the neutral face for parameters (P,)."""
        self.head.pose(self.head.values(dict(zip(PARAMETERS.names, values, strict=True))))
        return np.array([self.marks.place(name) for name in self.names]) - self._rest


def mirrored(table: ChannelTable, mirror: Mirror, face: Floats) -> Floats:
    """Parameters (P,) that the servos show for a face."""
    return np.where(table.reached, mirror.read(table.angles(face)[0]), PARAMETERS.neutral())


def rms(moves: Floats | Sequence[Floats]) -> float:
    """Root mean square of the lengths of moves (..., 3)."""
    return float(np.sqrt((np.asarray(moves) ** 2).sum(axis=-1).mean()))


def faces_of_take(path: Path) -> list[Floats]:
    """Parameters (P,) of frames of a take; eyes and head at rest, which a mirror shows by other parameters."""
    values = np.clip(np.nan_to_num(load_take(path, PARAMETERS).values[::EVERY]), PARAMETERS.low, PARAMETERS.high)
    values[:, [i for i, region in enumerate(PARAMETERS.regions) if region in ("eyes", "head")]] = 0.0
    return list(values)


def main(robot: str = "head24", head: str = "ict", take: Path | None = None) -> None:
    """Print the table."""
    face, settings = Head.load(find_config("heads", head)), load_robot(find_config("robots", robot), PARAMETERS)
    table = build_table(settings.channels, PARAMETERS, load_anchors(settings, face, PARAMETERS))
    skin, vocabulary = Skin(face), Vocabulary.load(PARAMETERS)
    known = vocabulary.faces()
    mirror = Mirror(table, PARAMETERS, known)
    out = Table("face", "landmarks move, mm rms", "mirror away, mm rms", "largest, mm", "at", "unknown, mm rms",
                "half, mm rms", title=f"faces and what the servos of {robot} show of them")  # fmt: skip

    def away(found: Mirror, sent: Floats) -> Floats:
        return skin.moved(mirrored(table, found, sent)) - skin.moved(sent)

    for name in EMOTIONS:
        weights = vocabulary[name].weights
        others = Mirror(table, PARAMETERS, known[(known != weights).any(axis=1)])
        missing = away(mirror, weights)
        worst = np.linalg.norm(missing, axis=1)
        out.add_row(name, f"{rms(skin.moved(weights)):.2f}", f"{rms(missing):.2f}", f"{worst.max():.2f}",
                    skin.names[int(worst.argmax())], f"{rms(away(others, weights)):.2f}",
                    f"{rms(away(mirror, 0.5 * weights)):.2f}")  # fmt: skip
    if take is not None:
        faces = faces_of_take(take)
        missing = np.array([away(mirror, each) for each in faces])
        size = rms([skin.moved(each) for each in faces])
        out.add_row(f"{len(faces)} of {take.name}", f"{size:.2f}", f"{rms(missing):.2f}",
                    f"{np.linalg.norm(missing, axis=2).max():.2f}", "", "", "")  # fmt: skip
    Console(width=150).print(out)


if __name__ == "__main__":
    typer.run(main)
