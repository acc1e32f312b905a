"""Draws the pictures of the README and of docs/picture.md: ``python docs/make_face_picture.py``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.face.still import for_head, sheet_poses
from controller.stage.stage import find_persons, load_head
from controller.vocabulary.vocabulary import Vocabulary
from surface.head import Head
from surface.view import PRESETS, Camera, Offscreen, compose, contact_sheet, write_png
from surface.view.pictures.imagefile import as_image, replacing

HERE = Path(__file__).parent
EXPRESSIONS = ("neutral", "laugh", "surprise", "sadness")
LOOKS = ("neutral", "happiness", "anger", "fear")
CAMERAS = ("front", "three-quarter", "profile")
SIZE = (400, 460)
PERSONS = ("birch", "maple", "oak", "willow", "olive", "cedar", "acacia", "ebony")
CLOSE = {
    "eyes": Camera.around(0, 1, distance=950, target=(0, 28, 70), fov_deg=6.5),
    "mouth": Camera.around(0, 1, distance=950, target=(0, -42, 85), fov_deg=5.5),
    "ear": Camera.around(75, 3, distance=950, target=(30, 15, 10), fov_deg=7),
}


def main() -> None:
    """Every picture, one after the other."""
    head = Head.load(find_config("heads", "ict"))
    write_png(np.hstack(faces(head)), HERE / "face.png")
    write_webp(looks(head, "skin"), HERE / "pictures" / "picture-skin.webp")
    write_webp(looks(head, "mask"), HERE / "pictures" / "picture-mask.webp")
    write_webp(looks(head, "robot"), HERE / "pictures" / "picture-robot.webp")
    write_webp(close(head), HERE / "pictures" / "picture-close.webp")
    entries = [(label, for_head(values, head.parameters)) for label, values in sheet_poses()]
    write_webp(persons(), HERE / "pictures" / "persons.webp")
    sheet = contact_sheet(head, entries, tile=(190, 200), columns=9)
    write_webp(np.asarray(sheet), HERE / "pictures" / "picture-sheet.webp")


def persons() -> np.ndarray:
    """All eight, with a slight smile."""
    folder, pictures = find_config("heads", "ict"), []
    for name in PERSONS:
        head = load_head(folder, {}, (), find_persons(name, folder))
        with Offscreen(head, (300, 330)) as screen:
            values = head.values({"mouthSmileLeft": 0.28, "mouthSmileRight": 0.24, "cheekSquintLeft": 0.15,
                                  "cheekSquintRight": 0.15})  # fmt: skip
            pictures.append(screen.render(values, Camera.around(30.0, 3.0, distance=1130.0, target=(0.0, 2.0, 20.0))))
    return np.asarray(compose(pictures, list(PERSONS), columns=4))


def posed(head: Head, name: str) -> np.ndarray:
    """Values of a named expression in the head's order."""
    values = PARAMETERS.neutral()
    for index, value in Vocabulary.load(PARAMETERS).expand(name).items():
        values[index] = value
    return for_head(values, head.parameters)


def faces(head: Head) -> list[np.ndarray]:
    """Four expressions, for the README."""
    camera = Camera.around(12.0, 4.0, distance=830.0, target=(0.0, 0.0, 40.0))
    with Offscreen(head, SIZE) as screen:
        return [screen.render(posed(head, name), camera) for name in EXPRESSIONS]


def looks(head: Head, theme: str) -> np.ndarray:
    """Expressions by cameras in one theme."""
    with Offscreen(head, (320, 340), theme=theme) as screen:
        rows = [
            np.hstack([screen.render(posed(head, name), PRESETS[camera]().zoom(1.1)) for name in LOOKS])
            for camera in CAMERAS
        ]
    return np.asarray(compose(rows, [f"{camera}: {', '.join(LOOKS)}" for camera in CAMERAS], columns=1))


def close(head: Head) -> np.ndarray:
    """Eyes, mouth and ear."""
    pose = posed(head, "happiness")
    with Offscreen(head, (440, 340)) as screen:
        pictures = [screen.render(pose, camera) for camera in CLOSE.values()]
    return np.asarray(compose(pictures, list(CLOSE), columns=len(CLOSE)))


def write_webp(picture: np.ndarray, path: Path) -> None:
    """Write (h, w, 3) uint8 pixels as WebP."""
    with replacing(path) as temporary:
        as_image(picture).save(temporary, format="WEBP", quality=82, method=6)


if __name__ == "__main__":
    main()
