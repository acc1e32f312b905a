"""Saves moved control points as a parameter of a user's own vocabulary: a slider, and a word of every link."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from controller.base.config import read_toml
from controller.base.errors import ParameterError
from controller.base.parameters import PARAMETERS, Floats, Parameters
from controller.base.paths import config_dir
from controller.panels.session.own_expressions import append, check_name
from controller.stage.inverse import GroupMoves, save_group
from controller.vocabulary.expression import read_expressions
from controller.vocabulary.vocabulary import Vocabulary
from surface.head import Head
from surface.head.model.light import WEIGHT
from surface.head.model.parameters import SHAPES

_MAX_FACTORS, _MIN_VALUE, _MIN_PRODUCT = 3, 0.1, 0.05


class Place(NamedTuple):
    """Where a parameter belongs: its region of the face, and the profile of its motion limits."""

    region: str
    profile: str


def save_own_group(
    path: Path, name: str, group: GroupMoves, place: Place, known: Vocabulary, parameters: Parameters,
    earlier: Sequence[Path] = (),
) -> None:  # fmt: skip
    """Save a group as the parameter ``name``, and as an expression that has it at 1.

    path : the vocabulary; the control points are in ``NAME.json`` beside it. place : see :func:`place_of`.
    known : the expressions that there are. earlier : the vocabularies before this one.

    Raises ParameterError: the name is taken or none, or no control point was moved. ControllerError: a file cannot be
    written, or would be wrong.
    """
    tables: dict[str, Any] = {
        "parameters": {name: {**place._asdict(), "range": [0.0, 1.0], "group": f"{name}.json"}},
        name: {"weights": {name: 1.0}},
    }
    _save(path, name, group, tables, known, parameters, earlier)


def save_corrective(
    path: Path, name: str, group: GroupMoves, face: Floats, place: Place, known: Vocabulary, parameters: Parameters,
    earlier: Sequence[Path] = (),
) -> tuple[str, ...]:  # fmt: skip
    """Save a group as a corrective of the face ``face`` (P,): it comes with the parameters that the face is made of.

    Its own parameter, 1 at rest, says how much of it is applied. Returns the parameters it comes with; see
    :func:`save_own_group` for the rest, and what it raises. Raises ParameterError also for a neutral face.
    """
    times = tuple(parameters.names[i] for i in _strongest(face, parameters))
    product = float(np.prod([face[parameters.index(each)] for each in times]))
    if not times or product < _MIN_PRODUCT:
        raise ParameterError(
            "a corrective belongs to a face: none of its shapes is strong", hint="show the face, then move the skin"
        )
    scaled = replace(group, moves=group.moves / product, light_moves=group.light_moves / product)
    entry = {**place._asdict(), "range": [0.0, 1.0], "rest": 1.0, "group": f"{name}.json", "times": list(times)}
    _save(path, name, scaled, {"parameters": {name: entry}}, known, parameters, earlier)
    return times


def place_of(head: Head, group: GroupMoves) -> Place:
    """Return the region and profile of the shape that moves the same control points the most; the mouth's where none
    does."""
    part, group = next(part for part in head.data.parts if part.name == group.part), _drop_added_points(head, group)
    moved = {each.name: _overlap(each.ids, each.moves, group) for each in part.groups if each.name in SHAPES}
    if not any(moved.values()):
        return Place("mouth", "mouth")
    shapes: Mapping[str, Any] = read_toml(config_dir() / "vocabularies" / "arkit.toml")["parameters"]
    shape = shapes[max(moved, key=lambda name: moved[name])]
    return Place(shape["region"], shape["profile"])


def _drop_added_points(head: Head, group: GroupMoves) -> GroupMoves:
    """Return a group with those of the head's own control points that count most where it adds some."""
    if group.light is None:
        return group
    share = head.part(group.part).surface.basis_matrix(group.light.centres)
    ids = np.asarray(share.argmax(axis=1)).ravel()
    moves = group.light_moves * WEIGHT
    return GroupMoves(group.part, np.concatenate([group.ids, ids]), np.concatenate([group.moves, moves]))


def _overlap(ids: np.ndarray, moves: np.ndarray, group: GroupMoves) -> float:
    """Return how far a shape moves the control points of a group, each weighted with how far the group moves it."""
    far = np.zeros(max(ids.max(initial=-1), group.ids.max(initial=-1)) + 1)
    np.add.at(far, ids, np.linalg.norm(np.asarray(moves, float), axis=1))
    return float((far[group.ids] * np.linalg.norm(group.moves, axis=1)).sum())


def _strongest(face: Floats, parameters: Parameters) -> list[int]:
    """Return the strongest shapes of a face, at most three."""
    there = [i for i in range(parameters.base) if parameters.names[i] in SHAPES and face[i] >= _MIN_VALUE]
    return sorted(sorted(there, key=lambda i: -face[i])[:_MAX_FACTORS])


def _save(
    path: Path, name: str, group: GroupMoves, tables: Mapping[str, Any], known: Vocabulary, parameters: Parameters,
    earlier: Sequence[Path],
) -> None:  # fmt: skip
    check_name(name, known)
    if (found := parameters.find(name)) is not None:
        raise ParameterError(f"there is a parameter {parameters.names[found]!r} already", hint="choose another name")
    if not len(group.ids) and group.light is None:
        raise ParameterError(
            "no control point was moved", hint="Ctrl, Shift and drag the skin first, or draw a wrinkle: tab Sculpt"
        )
    points = path.parent / f"{name}.json"
    if points.exists():
        raise ParameterError(f"{points}: there is such a file already", hint="choose another name")
    save_group(points, name, group)
    try:
        append(path, tables, lambda written: _read(written, earlier))
    except BaseException:
        points.unlink(missing_ok=True)
        raise


def _read(written: Path, earlier: Sequence[Path]) -> None:
    parameters = PARAMETERS.with_files([*earlier, written])
    read_expressions(parameters, [*earlier, written])
