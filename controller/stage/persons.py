"""Reads persons, which are files that define an appearance (skin, eyes, hair, clothes), and mixes several."""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from controller.base.config import Fraction, Number, Settings, load
from controller.base.errors import ConfigError, ParameterError
from controller.base.paths import config_dir, find_config

if TYPE_CHECKING:
    from surface.head.model.look import Colour, Look, Worn  # imported lazily: the body draws nothing

HexColour = Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$")]
Depth = Annotated[Number, Field(ge=0, le=2)]
PersonName = str | dict[str, Fraction]
WORN = ("hair", "beard", "clothes")
PERSON_HINT = "--person maple, or --person maple=0.5,oak=0.5"


class SkinSettings(Settings):
    """Appearance of the skin; see :class:`surface.head.model.look.Look`."""

    melanin: Fraction = 0.2
    blood: Annotated[Number, Field(ge=-1, le=1)] = 0.0
    redness: Annotated[Number, Field(ge=0, le=2)] = 1.0
    freckles: Fraction = 0.0
    age: Fraction = 0.0
    forehead: tuple[Depth, Depth, Depth] = (1.0, 1.0, 1.0)
    lips: HexColour | None = None


class EyeSettings(Settings):
    """Appearance of the eyes; ``fold`` : of the upper lids, how deep and how high, 1 as the head has it."""

    iris: HexColour | None = None
    fold: tuple[Depth, Depth] = (1.0, 1.0)


class BrowSettings(Settings):
    """Appearance of the brows."""

    colour: HexColour | None = None
    strength: Annotated[Number, Field(ge=0, le=1.5)] = 1.0


class WornSettings(Settings):
    """Hair, a beard or clothes; ``style`` : a name from configs/wardrobe, or a file."""

    style: str
    colour: HexColour = "#2b1d14"
    tips: HexColour | None = None
    gloss: Fraction = 1.0


class PersonSettings(Settings):
    """The contents of a person's file."""

    name: str
    description: str = ""
    identity: dict[str, Fraction] = {}
    skin: SkinSettings = SkinSettings()
    eyes: EyeSettings = EyeSettings()
    brows: BrowSettings = BrowSettings()
    hair: WornSettings | None = None
    beard: WornSettings | None = None
    clothes: WornSettings | None = None

    def look(self, beside: Path | None = None) -> Look:
        """Return the appearance of this person, with linear colours. ``beside`` : the person's file.

        Raises ConfigError: no such style.
        """
        from surface.head.model.look import Look  # imported lazily: the body draws nothing

        skin = self.skin
        worn = [_make_worn(kind, each, beside) for kind in WORN if (each := getattr(self, kind)) is not None]
        return Look(
            melanin=skin.melanin,
            blood=skin.blood,
            redness=skin.redness,
            freckles=skin.freckles,
            age=skin.age,
            forehead=skin.forehead,
            lips=linear(skin.lips),
            iris=linear(self.eyes.iris),
            brow=linear(self.brows.colour),
            brow_strength=self.brows.strength,
            fold=self.eyes.fold,
            worn=tuple(worn),
        )


def _make_worn(kind: str, settings: WornSettings, beside: Path | None) -> Worn:
    from surface.head.model.look import Worn  # imported lazily: as Look

    colour = linear(settings.colour) or (0.0, 0.0, 0.0)
    return Worn(find_style(kind, settings.style, beside), colour, linear(settings.tips), settings.gloss)


def find_style(kind: str, style: str, beside: Path | None = None) -> Path:
    """Return the file of a style of hair, beards or clothes.

    style : a path, also relative to the folder of ``beside``, or a name from configs/wardrobe.

    Raises ConfigError: no such style; lists the known ones.
    """
    folder = config_dir() / "wardrobe"
    places = [Path(style), folder / f"{kind}-{style}.npz"]
    if beside is not None:
        places.insert(0, beside.parent / style)
    for place in places:
        if os.path.isfile(place):  # unlike Path.is_file, returns False for names that no file system accepts
            return place
    known = sorted(path.stem.removeprefix(f"{kind}-") for path in folder.glob(f"{kind}-*.npz"))
    close = difflib.get_close_matches(style, known, n=1)
    guess = f", did you mean {close[0]!r}?" if close else ""
    raise ConfigError(f"{kind}.style: no {kind} {style!r}{guess}", hint=f"there are {', '.join(known)}, or give a path")


@dataclass(frozen=True)
class Person:
    """A person's file, read and checked."""

    path: Path
    settings: PersonSettings

    @property
    def look(self) -> Look:
        """The appearance, with linear colours and the files of styles."""
        return self.settings.look(self.path)


def load_person(path: Path) -> Person:
    """Read one person. Raises ConfigError: the file is wrong; lists every fault."""

    def check(settings: PersonSettings) -> list[str]:
        return [fault for kind in WORN if (fault := _style_fault(kind, getattr(settings, kind), path))]

    return Person(path, load(path, PersonSettings, check))


def _style_fault(kind: str, settings: WornSettings | None, path: Path) -> str:
    try:
        if settings is not None:
            find_style(kind, settings.style, path)
    except ConfigError as error:
        return f"{error} ({error.hint})"
    return ""


def read_persons(person: PersonName, beside: Path | None = None) -> list[tuple[Person, float]]:
    """Return the persons of a stage's key ``person`` with weights whose sum is 1; empty for an empty name.

    person : a name from configs/persons or a path, or several with weights. beside : the file that names them.

    Raises ConfigError: no such person, a person's file with faults, or weights that are all 0.
    """
    weights = {person: 1.0} if isinstance(person, str) else dict(person)
    weights = {name: weight for name, weight in weights.items() if name}
    total = sum(weights.values())
    if weights and total <= 0.0:
        raise ConfigError("person: all weights are 0", hint="person = { maple = 0.5, oak = 0.5 }")
    return [(load_person(find_config("persons", n, beside=beside)), w / total) for n, w in weights.items() if w > 0.0]


def mixed_identity(persons: Sequence[tuple[Person, float]], own: Mapping[str, float]) -> dict[str, float]:
    """Return the head's variations of a mixture of persons; amounts in ``own`` replace the mixed ones."""
    mixed: dict[str, float] = {}
    for person, weight in persons:
        for name, amount in person.settings.identity.items():
            mixed[name] = mixed.get(name, 0.0) + weight * amount
    return mixed | dict(own)


def mixed_look(persons: Sequence[tuple[Person, float]], *, dressed: bool = True) -> Look | None:
    """Return the appearance of a mixture of persons, or None without persons.

    Numbers and colours are averaged by the weights; everything else is taken from the person with the largest weight.
    Unless ``dressed``, nothing is worn.
    """
    if not persons:
        return None
    looks = [(person.look, weight) for person, weight in persons]
    dominant = max(looks, key=lambda each: each[1])[0]
    values = {
        field.name: _mean([(getattr(look, field.name), w) for look, w in looks], getattr(dominant, field.name))
        for field in fields(dominant)
    }
    return replace(dominant, **(values if dressed else values | {"worn": ()}))


def _mean(values: list[tuple[Any, float]], fallback: Any) -> Any:
    """Return the weighted mean of numbers, or of colours; ``fallback`` if any value is neither."""
    if all(isinstance(value, float | int) for value, _ in values):
        return sum(value * weight for value, weight in values)
    if all(isinstance(value, tuple) and len(value) == 3 and isinstance(value[0], float) for value, _ in values):
        return tuple(sum(value[k] * weight for value, weight in values) for k in range(3))
    return fallback


def linear(text: str | None) -> Colour | None:
    """Convert ``#rrggbb`` (sRGB) to linear RGB 0..1 (IEC 61966-2-1); None stays None."""
    if text is None:
        return None
    encoded = [int(text[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in encoded)
    return red, green, blue


def parse_person(text: str | None) -> PersonName | None:
    """Convert ``maple`` or ``maple=0.5,oak=0.5`` of the command line to a value of the key; None stays None.

    Raises ParameterError: a weight that is not a number from 0 to 1.
    """
    if text is None or "=" not in text:
        return text
    weights: dict[str, float] = {}
    for word in text.split(","):
        name, _, number = (x.strip() for x in word.rpartition("="))
        try:
            weights[name] = float(number)
        except ValueError as error:
            raise ParameterError(f"--person {word.strip()}: {number!r} is not a number", hint=PERSON_HINT) from error
        if not name or not 0.0 <= weights[name] <= 1.0:
            raise ParameterError(f"--person {word.strip()}: expected NAME=WEIGHT, 0 to 1", hint=PERSON_HINT)
    return weights
