"""Adds expressions to a user's own vocabulary file."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import tomli_w

from controller.base.errors import ConfigError, ParameterError
from controller.base.files import replacing
from controller.base.parameters import Floats, Parameters, fold
from controller.vocabulary.expression import read_expressions
from controller.vocabulary.vocabulary import Vocabulary
from surface.base.files import read_text, reading

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
_LEAST = 0.005
_MOST_BYTES = 1 << 20


def save_expression(
    path: Path, name: str, values: Floats, known: Vocabulary, parameters: Parameters, earlier: Sequence[Path] = ()
) -> Floats:
    """Add the face ``values`` (P,) to a vocabulary file as an expression; returns its weights (P,), as written.

    The rest of the file stays as it is, comments included; a file that is not there is begun. Values below 0.005 are
    left out, the others are rounded to 3 decimals.

    known : the expressions that there are. earlier : files whose expressions those of this file may mix.

    Raises ParameterError: the name is none that a line of the protocol can have, or is taken, or the face is neutral.
    ControllerError: the file cannot be read or written, or is wrong.
    """
    _check_name(name, known)
    still = np.abs(values - parameters.rest) < _LEAST
    face = np.clip(np.where(still, parameters.rest, np.round(values, 3)), parameters.low, parameters.high)
    weights: Floats = face - parameters.rest
    if not weights.any():
        raise ParameterError("the face is neutral: there is nothing to save", hint="move sliders first")
    table = {name: {"weights": {parameters.names[i]: float(face[i]) for i in np.flatnonzero(weights)}}}
    before = "# Expressions saved in the window of omote run.\n"
    if path.exists():
        with reading(path, ConfigError):
            before = read_text(path, _MOST_BYTES)
    with replacing(path) as temporary:
        temporary.write_text(f"{before.rstrip()}\n\n{tomli_w.dumps(table)}", encoding="utf-8")
        _check_file(temporary, path, parameters, earlier)
    return weights


def _check_name(name: str, known: Vocabulary) -> None:
    if not _NAME.fullmatch(name):
        raise ParameterError(f"{name!r} cannot be a name", hint="use letters, digits and _, as soft_smile")
    if fold(name) in map(fold, known.names):
        raise ParameterError(f"there is an expression {name!r} already", hint="choose another name")


def _check_file(written: Path, path: Path, parameters: Parameters, earlier: Sequence[Path]) -> None:
    """Raise ConfigError, before the file is replaced, where it could not be read again."""
    try:
        read_expressions(parameters, [*earlier, written])
    except ConfigError as error:
        raise ConfigError(str(error).replace(str(written), str(path)), hint=error.hint) from error
