"""Identities on the command line and in stages: named variations of a head, each with an amount."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from controller.base.errors import ConfigError, ParameterError


def parse_identity(text: str | None) -> dict[str, float]:
    """``broad=0.6,young=0.4`` as names and amounts; a name alone counts 1.

    Raises
    ------
    ParameterError
        naming the word that is not NAME=AMOUNT, or an amount that is not 0 to 1.
    """
    out: dict[str, float] = {}
    for word in (text or "").split(","):
        name, equals, amount = (x.strip() for x in word.partition("="))
        if not word.strip():
            continue
        try:
            out[name] = float(amount) if equals else 1.0
        except ValueError as error:
            raise ParameterError(f"--identity {word.strip()}: {amount!r} is not a number", hint=EXAMPLE) from error
        if not name or not 0.0 <= out[name] <= 1.0:
            raise ParameterError(f"--identity {word.strip()}: expected NAME=AMOUNT, 0 to 1", hint=EXAMPLE)
    return out


EXAMPLE = "--identity broad=0.6,young=0.4"


def check_identity(head: Path, wanted: Mapping[str, float]) -> None:
    """Raise ConfigError for a name that the head in folder ``head`` does not have."""
    from surface.head.model.identity import load_identities  # start-up: --help loads this module

    known = load_identities(head) if wanted else {}
    for name in wanted:
        if name not in known:
            there = ", ".join(known) or "none"
            raise ConfigError(f"{head}: no identity {name!r}; there are {there}", hint="see docs/heads.md")
