"""Draws the pictures of docs/gallery.md: ``python -m docs.make_gallery``."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.face.still import for_head
from controller.face.wall import Wall
from controller.panels.session.own_groups import place_of, save_corrective, save_own_group
from controller.stage.inverse import SculptSolver
from controller.stage.stage import find_persons, load_head, load_stage
from controller.vocabulary.vocabulary import Vocabulary
from docs.make_face_picture import PERSONS, write_webp
from surface.head import Head
from surface.view import Camera, Offscreen, compose

PAGE, PICTURES = Path(__file__).with_name("gallery.md"), Path(__file__).parent / "pictures"
SIZE = (300, 330)
SHOWN = ("laugh", "surprise", "doubt", "anger", "thinking", "kiss", "disgust", "wink")
CHEEK_MM = (41.0, -36.0, 86.0)
SMILE = {"mouthSmileLeft": 0.8, "cheekSquintLeft": 0.3}
_CAMERA = Camera.around(24.0, 3.0, distance=1050.0, target=(0.0, 2.0, 20.0))
_CLOSE = Camera.around(38.0, 0.0, distance=900.0, target=(20.0, -20.0, 70.0), fov_deg=9.0)


def emotions(size: tuple[int, int] = SIZE) -> np.ndarray:
    """Each person with an expression."""
    vocabulary, pictures = Vocabulary.load(PARAMETERS), []
    folder = find_config("heads", "ict")
    for person, name in zip(PERSONS, SHOWN, strict=True):
        head = load_head(folder, {}, (), find_persons(person, folder))
        values = PARAMETERS.rest + vocabulary[name].pose(1.0)
        with Offscreen(head, size) as screen:
            pictures.append(screen.render(for_head(values, head.parameters), _CAMERA))
    return np.asarray(compose(pictures, list(SHOWN), columns=4))


def themes(size: tuple[int, int] = SIZE) -> np.ndarray:
    """One face in each theme."""
    head, pictures = Head.load(find_config("heads", "ict")), []
    values = for_head(PARAMETERS.rest + Vocabulary.load(PARAMETERS)["happiness"].pose(1.0), head.parameters)
    for theme in ("skin", "mask", "robot"):
        with Offscreen(head, size, theme=theme) as screen:
            pictures.append(screen.render(values, _CAMERA))
    return np.asarray(compose(pictures, ["skin", "mask", "robot"], columns=3))


def own_shapes(size: tuple[int, int] = SIZE) -> np.ndarray:
    """A sweet that was put into the cheek: as a group, and as a corrective of the smile."""
    with tempfile.TemporaryDirectory() as folder:
        own = save_sweet(Path(folder))
        head = load_stage("demo", PARAMETERS, [own]).load_head()
        faces = ({}, {"sweet": 1.0}, SMILE, SMILE | {"smile_sweet": 1.0})
        with Offscreen(head, size) as screen:
            pictures = [screen.render(head.values(face), _CLOSE) for face in faces]
    return np.asarray(compose(pictures, ["at rest", "sweet 1", "a smile", "with smile_sweet"], columns=4))


def save_sweet(folder: Path) -> Path:
    """Save a sweet in the cheek as a group and as a corrective, as the window does; the vocabulary they are in."""
    stage, own = load_stage("demo", PARAMETERS), folder / "mine.toml"
    head = stage.load_head()
    face = head.part("face")
    at = int(np.argmin(np.linalg.norm(face.vertices[: len(face.mesh.uv)] - CHEEK_MM, axis=1)))
    solver = SculptSolver(head, fairness=1.0)
    group = solver.solve(face.mesh.uv[at : at + 1].astype(float), 9.0 * face.normals[at : at + 1].astype(float))
    place, smile = place_of(head, group), PARAMETERS.neutral()
    smile[PARAMETERS.indices(list(SMILE))] = list(SMILE.values())
    save_own_group(own, "sweet", group, place, stage.vocabulary, PARAMETERS)
    save_corrective(own, "smile_sweet", group, smile, place, stage.vocabulary, PARAMETERS)
    return own


def room(size: tuple[int, int] = (960, 360)) -> np.ndarray:
    """The three heads of the stage ``choir``, each with an expression."""
    stage = load_stage("choir", PARAMETERS)
    rows = [stage.parameters.rest + stage.vocabulary[name].pose(1.0) for name in ("smile", "interest", "surprise")]
    with Wall(stage, stage.parameters, size) as wall:
        return np.asarray(compose(wall.pictures(np.array(rows)), wall.names, columns=wall.columns))


DRAWN: dict[str, Callable[[], np.ndarray]] = {
    "gallery-emotions.webp": emotions,
    "gallery-themes.webp": themes,
    "gallery-own.webp": own_shapes,
    "gallery-room.webp": room,
}


def main() -> None:
    """Every picture, one after the other."""
    for name, draw in DRAWN.items():
        write_webp(draw(), PICTURES / name)


if __name__ == "__main__":
    main()
