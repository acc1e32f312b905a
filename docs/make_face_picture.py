"""Draws docs/face.png, the picture at the top of the README: ``python docs/make_face_picture.py``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from controller.expression import Vocabulary
from controller.parameters import PARAMETERS
from controller.paths import find_config
from controller.still import for_head
from surface.head import Head
from surface.view import Camera, Offscreen, write_png

EXPRESSIONS = ("neutral", "laugh", "surprise", "sadness")
SIZE = (400, 460)


def main() -> None:
    """Four expressions side by side."""
    head = Head.load(find_config("heads", "ict"))
    vocabulary = Vocabulary.load(PARAMETERS)
    camera = Camera.around(12.0, 4.0, distance=830.0, target=(0.0, 0.0, 40.0))
    pictures = []
    with Offscreen(head, SIZE) as screen:
        for name in EXPRESSIONS:
            values = PARAMETERS.neutral()
            for index, value in vocabulary.expand(name).items():
                values[index] = value
            pictures.append(screen.render(for_head(values, head.parameters), camera))
    write_png(np.hstack(pictures), Path(__file__).parent / "face.png")


if __name__ == "__main__":
    main()
