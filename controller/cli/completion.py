"""Completes names in the shell: of configuration files, parameters, expressions, identities and servo models.

Each completion takes the beginning of a word and never raises, because the shell would print the error into the line
that the user is typing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

Complete = Callable[[str], list[str]]


def _completion_from(names: Callable[[], Iterable[str]]) -> Complete:
    """Return a completion of ``names``; if they cannot be read, it completes nothing."""

    def complete(incomplete: str) -> list[str]:
        try:
            return sorted(name for name in names() if name.startswith(incomplete))
        except Exception:  # noqa: BLE001  a damaged file is reported by the command, not by the shell
            return []

    return complete


def names_of(kind: str) -> Complete:
    """Return a completion of the names in the folder ``kind`` of configs; the shell itself completes paths."""

    def names() -> Iterable[str]:
        from controller.base.paths import config_dir  # imported lazily: only completion needs it

        return (path.stem for path in (config_dir() / kind).iterdir() if not path.name.startswith("."))

    return _completion_from(names)


def _settings() -> Iterable[str]:
    from controller.base.parameters import PARAMETERS  # imported lazily: only completion needs it

    return (f"{name}=" for name in PARAMETERS.names)


def _expressions() -> Iterable[str]:
    # imported lazily: only completion needs them
    from controller.base.parameters import PARAMETERS
    from controller.vocabulary.vocabulary import Vocabulary

    return Vocabulary.load(PARAMETERS).names


def _identities() -> Iterable[str]:
    # imported lazily: only completion needs them
    from controller.base.paths import find_config
    from surface.head.model.identity import load_identities

    return (f"{name}=" for name in load_identities(find_config("heads", "ict")))


def _models() -> Iterable[str]:
    from drivers.tables.tables import known_models  # imported lazily: only completion needs it

    return known_models().values()


settings, expressions, identities, models = map(_completion_from, (_settings, _expressions, _identities, _models))
