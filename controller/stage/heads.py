"""The heads of a stage that has several: their tables, the groups they belong to, and their places in the room."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from controller.base.config import Fraction, Number, Settings
from controller.base.parameters import did_you_mean
from controller.base.placement import Placement
from controller.layers.heads import EVERYBODY
from controller.links.links import LinkTable
from controller.stage.persons import PersonName

MAX_HEADS = 256
"""Heads of one stage."""
_SPACING_MM = 450.0
"""Distance between heads that the stage does not place, which stand side by side."""
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,31}")
_Millimetres = Annotated[Number, Field(ge=-1e5, le=1e5)]
Names = Annotated[list[str], Field(min_length=1, max_length=MAX_HEADS)]


class HeadSettings(Settings):
    """One entry of ``[[heads]]``. A key that it omits has the stage's value; see :func:`own_settings`."""

    name: str
    person: PersonName | None = None
    head: str | None = None
    identity: dict[str, Fraction] | None = None
    robots: Annotated[list[str], Field(max_length=32)] = []
    links: Annotated[list[LinkTable], Field(max_length=64)] = []
    layers: Annotated[dict[str, dict[str, Any]], Field(max_length=64)] = {}
    liveliness: Fraction | None = None
    life: str | None = None
    manner: Literal["auto", "alone", "listen", "speak"] | None = None
    seed: Annotated[int, Field(ge=0)] | None = None
    show: str | None = None
    take: str | None = None
    voice: str | None = None
    position_mm: tuple[_Millimetres, _Millimetres, _Millimetres] | None = None
    yaw_deg: Annotated[Number, Field(ge=-180, le=180)] = 0.0

    @field_validator("name")
    @classmethod
    def _is_name(cls, value: str) -> str:
        if not _NAME.fullmatch(value):
            raise ValueError("a name begins with a letter, then letters, digits, _ and -, 32 at most")
        if value.lower() == EVERYBODY:
            raise ValueError(f"@{EVERYBODY} means every head; choose another name")
        return value

    def placement(self, index: int, count: int) -> Placement:
        """Return its place: as given, or in a row in which the first head is on the left of a viewer."""
        x_mm = (0.5 * (count - 1) - index) * -_SPACING_MM
        return Placement(self.position_mm or (x_mm, 0.0, 0.0), self.yaw_deg)


def own_settings(stage: Mapping[str, Any], head: HeadSettings, index: int) -> dict[str, Any]:
    """Return the keys of the stage's settings that change for one of its heads.

    The stage's own robots, links, show, take and voice belong to its first head.

    stage : the stage's settings by key. index : of the head in the stage.
    """
    first = index == 0
    found: dict[str, Any] = {"heads": [], "zenoh": None, "seed": stage["seed"] + index}
    for key in ("head", "identity", "liveliness", "life", "manner", "seed"):
        if (own := getattr(head, key)) is not None:
            found[key] = own
    for key in ("robots", "links"):
        found[key] = [*(stage[key] if first else []), *getattr(head, key)]
    for key in ("show", "take", "voice"):
        found[key] = getattr(head, key) or (stage[key] if first else None)
    names = {**stage["layers"], **head.layers}
    found["layers"] = {name: {**stage["layers"].get(name, {}), **head.layers.get(name, {})} for name in names}
    if head.person is not None:
        found["face"] = stage["face"].model_copy(update={"person": head.person})
    return found


def head_faults(heads: Sequence[HeadSettings], groups: Mapping[str, Sequence[str]]) -> list[str]:
    """Return the faults of heads and groups: repeated or invalid names, and groups of unknown heads."""
    faults, seen = [], dict[str, int]()
    for i, head in enumerate(heads):
        if seen.setdefault(head.name.lower(), i) != i:
            faults.append(f"heads[{i}].name: {head.name!r} is the name of heads[{seen[head.name.lower()]}]")
    names = [head.name for head in heads]
    for group, members in groups.items():
        if group.lower() in seen or group.lower() == EVERYBODY or not _NAME.fullmatch(group):
            faults.append(f"groups.{group}: choose another name: one word, and not the name of a head")
        faults += [
            f"groups.{group}: no head called {name!r}{did_you_mean(name, names)}"
            for name in members
            if name.lower() not in seen
        ]
    return faults
