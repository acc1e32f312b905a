"""Adds expressions to a user's own vocabulary file."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from controller.base.errors import ConfigError, ParameterError
from controller.base.files import replacing
from controller.base.parameters import Floats, Parameters, fold
from controller.vocabulary.expression import read_expressions
from controller.vocabulary.vocabulary import Vocabulary
from surface.base.files import read_text, reading

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
_MIN_VALUE = 0.005
_MAX_BYTES = 1 << 20


def save_expression(
    path: Path, name: str, values: Floats, known: Vocabulary, parameters: Parameters, earlier: Sequence[Path] = (),
    kind: str = "user",
) -> Floats:  # fmt: skip
    """Add the face ``values`` (P,) to a vocabulary file as an expression; returns its weights (P,), as written.

    The rest of the file stays as it is, comments included; a missing file is created. Values below 0.005 are
    left out, the others are rounded to 3 decimals.

    known : the expressions that there are. earlier : files whose expressions those of this file may mix.
    kind : ``"gesture"`` for one that keeps the mood, see :class:`controller.vocabulary.expression.Expression`.

    Raises ParameterError: the name is none that a line of the protocol can have, or is taken, or the face is neutral.
    ControllerError: the file cannot be read or written, or is wrong.
    """
    check_name(name, known)
    still = np.abs(values - parameters.rest) < _MIN_VALUE
    face = np.clip(np.where(still, parameters.rest, np.round(values, 3)), parameters.low, parameters.high)
    weights: Floats = face - parameters.rest
    if not weights.any():
        raise ParameterError("the face is neutral: there is nothing to save", hint="move sliders first")
    entry = {"weights": {parameters.names[i]: float(face[i]) for i in np.flatnonzero(weights)}}
    table = {name: ({"kind": kind} if kind != "user" else {}) | entry}
    append(path, table, lambda written: read_expressions(parameters, [*earlier, written]))
    return weights


def append(path: Path, table: Mapping[str, Any], check: Callable[[Path], object]) -> None:
    """Add tables to the end of a vocabulary file, or begin it; the rest of it stays as it is, comments included.

    ``check`` : reads the written file before it replaces the other.

    Raises ControllerError: the file cannot be read or written, or would be wrong.
    """
    before = "# Saved in the window of omote run.\n"
    if path.exists():
        with reading(path, ConfigError):
            before = read_text(path, _MAX_BYTES)
    with replacing(path) as temporary:
        temporary.write_text(f"{before.rstrip()}\n\n{tomli_w.dumps(table)}", encoding="utf-8")
        try:
            check(temporary)
        except ConfigError as error:
            raise ConfigError(str(error).replace(str(temporary), str(path)), hint=error.hint) from error


def check_name(name: str, known: Vocabulary) -> None:
    """Raise ParameterError for a name that no line of the protocol can have, or that an expression has."""
    if not _NAME.fullmatch(name):
        raise ParameterError(f"{name!r} cannot be a name", hint="use letters, digits and _, as soft_smile")
    if fold(name) in map(fold, known.names):
        raise ParameterError(f"there is an expression {name!r} already", hint="choose another name")
