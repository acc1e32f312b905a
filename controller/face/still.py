"""Draws one picture, or a contact sheet, of a head from the options of a command line."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controller.base.errors import ConfigError, ParameterError
from controller.base.parameters import PARAMETERS, Parameters
from controller.base.paths import config_dir, find_config
from controller.face.face import head_indices
from controller.face.wall import Wall
from controller.stage.persons import Person
from controller.stage.picture import PictureSettings, with_options
from controller.stage.stage import (
    FaceSettings,
    Stage,
    check_identity,
    find_persons,
    load_head,
    load_stage,
    parse_identity,
    with_picture,
)
from controller.vocabulary.sides import sides
from controller.vocabulary.vocabulary import Vocabulary
from surface.head import Crowd, Head
from surface.view.pictures.offscreen import Offscreen
from surface.view.pictures.sheet import compose, contact_sheet, crowd_sheet, write_png
from surface.view.scene.camera import Camera
from surface.view.scene.framing import framed

CHORD_PIXELS = 0.42  # an outline bends unseen by less; up to 800 pixels the shipped head is as it is stored
SHOWN_MM = 470.0  # of the shipped head, along a side of a picture that the named cameras take


@dataclass(frozen=True)
class Still:
    """A picture to draw.

    values : (p,) float64, the full parameter vector. size : width and height (pixels). look : theme, camera and so on.
    head : folder of the head. identity : its variations, by name. groups : group files and their amounts.
    vocabulary : the named expressions. persons : the persons that it shows, each with its weight.
    parameters : those of the stage and of the named vocabularies.
    wall : a stage of several heads, which are all drawn; None for one head. stage : whose layers and idle motion films
    show; None without a stage.
    """

    values: NDArray[np.float64]
    size: tuple[int, int]
    look: PictureSettings
    head: Path
    identity: dict[str, float]
    groups: tuple[tuple[Path, float], ...]
    vocabulary: Vocabulary
    persons: tuple[tuple[Person, float], ...] = ()
    parameters: Parameters = field(default_factory=lambda: PARAMETERS)
    wall: Stage | None = None
    stage: Stage | None = None

    @classmethod
    def parse(
        cls, settings: list[str], expressions: list[str], size: str | None = None,
        look: Mapping[str, object] | None = None, head: str | None = None, identity: str | None = None, *,
        stage: str | None = None, vocabularies: Sequence[str] = (), groups: Sequence[str] = (),
    ) -> Still:  # fmt: skip
        """Read the options of a command line; omitted options are taken from the stage, if there is one.

        Raises ParameterError or ConfigError, which names the invalid word and what is expected.
        """
        more = [find_config("vocabularies", name).resolve() for name in vocabularies]
        base = load_stage(stage, PARAMETERS, more) if stage else None
        files = base.vocabularies if base else more
        parameters = (base.parameters if base else PARAMETERS).with_files(files)
        vocabulary = Vocabulary.load(parameters, more=files)
        values = parameters.neutral()
        for word in expressions:
            _add_expression(parameters, vocabulary, values, word)
        for word in settings:
            places, value = parse_setting(word, parameters)
            values[places] = value
        wall = None
        if base is not None and base.heads and head is None:
            wall = with_picture(base, look or {})
            reject_for_wall(wall, {"--identity": identity, "--group": groups})
        folder = base.head if base and head is None else find_config("heads", head or "ict")
        wanted = dict(base.settings.identity) if base and identity is None else parse_identity(identity)
        check_identity(folder, wanted)
        added = (*(base.groups if base else ()), *(parse_group(word) for word in groups))
        face = base.settings.face if base else FaceSettings()
        width_height = parse_size(size or "800x800") if size or base is None else face.size
        picture = with_options(face, look or {})
        persons = tuple(find_persons(picture.person, folder, beside=base.path if base else None))
        return cls(values, width_height, picture, folder, wanted, added, vocabulary, persons, parameters, wall, base)

    def load_head(self, chord_mm: float | None = None) -> Head:
        """Load the head with its persons, identity and groups; see :func:`controller.stage.stage.load_head`."""
        dressed = self.look.dressed
        own = self.parameters.point_groups
        return load_head(
            self.head, self.identity, self.groups, self.persons, dressed=dressed, own=own, chord_mm=chord_mm
        )

    @property
    def chord_mm(self) -> float:
        """How far the edges of triangles may lie from the skin, mm, so that no outline of the picture shows them."""
        return CHORD_PIXELS * SHOWN_MM / max(self.size)


def reject_for_wall(wall: Stage, options: Mapping[str, object]) -> None:
    """Raise ConfigError for an option that is given and that a picture of several heads cannot have.

    wall : a stage of several heads. options : values of such options, by name.
    """
    for option in [name for name, value in options.items() if value]:
        first = wall.heads[0].stage
        shipped = first.head.parent == config_dir() / "heads"
        person = f" --person {first.settings.face.person}" if isinstance(first.settings.face.person, str) else ""
        raise ConfigError(
            f"{option} is for one head, and {wall.path} has {len(wall.heads)}",
            hint=f"name the head that is meant: --head {first.head.name if shipped else first.head}{person}",
        )


def parse_group(word: str) -> tuple[Path, float]:
    """Parse ``FILE=AMOUNT``, with an amount from -1 to 1, by default 1."""
    name, amount = _name_and_amount(word, "--group")
    if not -1.0 <= amount <= 1.0:
        raise ParameterError(f"--group {word}: the amount goes from -1 to 1")
    return find_config("groups", name), amount


def parse_setting(word: str, parameters: Parameters | None = None) -> tuple[list[int], float]:
    """Parse ``NAME=VALUE`` as indices of parameters and their value, which must be in their range.

    A name without a side means both. Raises ParameterError.
    """
    name, equals, text = word.partition("=")
    if not equals:
        raise ParameterError(f"--set {word}: expected NAME=VALUE", hint="for example --set jawOpen=0.8")
    parameters = parameters or PARAMETERS
    places = sides(parameters, name) or [parameters.index(name)]
    value = _number(f"--set {word}", text)
    for index in places:
        low, high = parameters.low[index], parameters.high[index]
        if not low <= value <= high:
            raise ParameterError(f"--set {word}: {parameters.names[index]} goes from {low:g} to {high:g}")
    return places, value


def _number(where: str, text: str) -> float:
    """Parse a finite number. Raises ParameterError, whose message begins with ``where``."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ParameterError(f"{where}: {text!r} is not a number")
    return value


def parse_size(text: str) -> tuple[int, int]:
    """Parse ``800x600`` as (800, 600)."""
    match = re.fullmatch(r"(\d{1,5})[xX](\d{1,5})", text.strip())
    size = (int(match[1]), int(match[2])) if match else (0, 0)
    if min(size) < 16 or max(size) > 16384:
        raise ParameterError(f"--size {text}: expected WIDTHxHEIGHT, each 16 to 16384", hint="--size 800x800")
    return size


def _name_and_amount(word: str, option: str) -> tuple[str, float]:
    """Parse ``NAME=AMOUNT``, with the default amount 1."""
    name, equals, text = word.rpartition("=")
    return (name, _number(f"{option} {word}", text)) if equals else (word, 1.0)


def _add_expression(parameters: Parameters, vocabulary: Vocabulary, values: NDArray[np.float64], word: str) -> None:
    name, intensity = _name_and_amount(word, "--expression")
    if not 0.0 <= intensity <= 1.0:
        raise ParameterError(f"--expression {word}: the intensity goes from 0 to 1")
    values += vocabulary[name].pose(intensity)
    np.clip(values, parameters.low, parameters.high, out=values)


def _camera(look: PictureSettings, head: Head) -> Camera:
    """The camera of a look, which shows this head."""
    return framed(look.make_camera(), head, worn=look.dressed)


def draw_still(still: Still, out: Path) -> None:
    """Draw ``still`` and write it to ``out`` (PNG), completely or not at all."""
    if still.wall is not None:
        _draw_wall(still.wall, still, out)
        return
    head, look = still.load_head(still.chord_mm), still.look
    with Offscreen(
        head, still.size, quality=look.still_quality, theme=look.make_theme(), evaluator=look.evaluator
    ) as screen:
        picture = screen.render(for_head(still.values, head.parameters, still.parameters), _camera(look, head))
    write_png(picture, out)


def _draw_wall(stage: Stage, still: Still, out: Path) -> None:
    """Draw all heads of a stage side by side, each with its name."""
    with Wall(stage, still.parameters, still.size) as wall:
        pictures = wall.pictures(np.tile(still.values, (len(wall.names), 1)))
        write_png(compose(pictures, wall.names, columns=wall.columns), out)


def for_head(
    values: NDArray[np.float64], wanted: tuple[str, ...], parameters: Parameters | None = None
) -> NDArray[np.float64]:
    """Return the values of a full vector (p,) in the order of a head (h,); 0 for names that omote does not know.

    wanted : names of the head's parameters. parameters : of the vector. Default: the base vocabulary.
    """
    return np.append(values, 0.0)[head_indices(parameters or PARAMETERS, wanted)]


def sheet_poses(
    vocabulary: Vocabulary | None = None, parameters: Parameters | None = None
) -> list[tuple[str, NDArray[np.float64]]]:
    """Return label and full parameter vector of every picture on the sheet: expressions, then parameters."""
    parameters = parameters or PARAMETERS
    vocabulary = vocabulary or Vocabulary.load(parameters)
    poses = [(name, parameters.rest + vocabulary[name].pose(1.0)) for name in vocabulary.names]
    for index, name in enumerate(parameters.names):
        two_sided = parameters.low[index] < 0
        if two_sided:
            poses.append((f"{name} \N{MINUS SIGN}", _vector(parameters, index, parameters.low[index])))
        poses.append((f"{name} +" if two_sided else name, _vector(parameters, index, parameters.high[index])))
    return poses


def _vector(parameters: Parameters, index: int, value: float) -> NDArray[np.float64]:
    """Return the neutral face with one parameter set."""
    vector = parameters.neutral()
    vector[index] = value
    return vector


def draw_sheet(still: Still, out: Path, progress: Callable[[int, int], None] | None = None) -> None:
    """Draw every parameter and every named expression on one sheet (PNG); calls ``progress(done, total)``."""
    head, look = still.load_head(), still.look
    poses = sheet_poses(still.vocabulary, still.parameters)
    entries = [(label, for_head(values, head.parameters, still.parameters)) for label, values in poses]
    page = contact_sheet(
        head, entries, views=[_camera(look, head)], quality=look.still_quality, theme=look.make_theme(),
        progress=progress,
    )  # fmt: skip
    write_png(page, out)


def crowd_poses(still: Still, count: int) -> list[tuple[str, NDArray[np.float64]]]:
    """Return label and full parameter vector of ``count`` heads.

    Each shows the face of ``still`` with the next named expression, and a random but reproducible head direction.
    """
    rng, names = np.random.default_rng(count), still.vocabulary.names
    parameters = still.parameters
    looks = [parameters.index(name) for name in ("headYaw", "headPitch", "headRoll")]
    poses = []
    for k in range(count):
        name = names[k % len(names)]
        values = still.values + still.vocabulary[name].pose(1.0 if k < len(names) else 0.6)
        values[looks] += rng.uniform(-0.3, 0.3, len(looks))
        poses.append((name, np.clip(values, parameters.low, parameters.high)))
    return poses


def draw_crowd(still: Still, count: int, out: Path, progress: Callable[[int, int], None] | None = None) -> None:
    """Draw ``count`` heads, which are posed in one batch, on one sheet (PNG); calls ``progress(done, total)``.

    Raises ParameterError: the still is to be evaluated by the GPU.
    """
    if still.look.evaluator == "gpu":
        raise ParameterError("a crowd is posed by the CPU", hint="leave out --evaluator gpu")
    head, look, poses = still.load_head(), still.look, crowd_poses(still, count)
    crowd = Crowd(head, count)
    crowd.pose(np.stack([for_head(values, head.parameters, still.parameters) for _, values in poses]))
    page = crowd_sheet(
        crowd, [label for label, _ in poses], camera=_camera(look, head), quality=look.still_quality,
        theme=look.make_theme(), columns=math.isqrt(count - 1) + 1, progress=progress,
    )  # fmt: skip
    write_png(page, out)
