"""Finds configuration files: beside the code in a source folder, under share/ when installed.

An installer puts ``share/`` into the environment, into the user's folder, or beside the code (``pip install
--target``), and records the place in the package's metadata. The folder beside the code is tried first, then the
recorded one.
"""

from __future__ import annotations

import difflib
import os
import site
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from controller.base.errors import ConfigError

VARIABLE = "OMOTE_CONFIGS"
"""Environment variable that names another configuration folder."""
_SHARE = Path("share/omote/configs")


def config_dir() -> Path:
    """Return the folder with heads, vocabularies, robots and stages. Raises ConfigError: it is not found."""
    looked: list[Path] = []
    for folder in _candidates():
        if (folder / "vocabularies").is_dir():
            return folder
        looked.append(folder)
    raise ConfigError(
        f"the configuration folder is missing; looked in {', '.join(map(str, dict.fromkeys(looked)))}",
        hint=f"set {VARIABLE} to a folder that holds vocabularies/ and heads/",
    )


def find_config(kind: str, name: str, *, beside: Path | None = None) -> Path:
    """Return the configuration file, or the folder of a head, that ``name`` means.

    kind : a folder of configs, as ``"heads"``, ``"robots"``, ``"stages"``, ``"vocabularies"`` or ``"scripts"``.
    name : a path (also relative to the folder of ``beside``), or a name from ``configs/<kind>``.
    beside : the file that contains ``name``.

    Raises ConfigError: no file of that name; the message lists the known names.
    """
    folder = config_dir() / kind
    places = [Path(name), folder / name, folder / f"{name}.toml"]
    if beside is not None:
        places.insert(0, beside.parent / name)
    for place in places:
        found = place / "head.toml" if kind == "heads" else place
        if os.path.exists(found) and not os.path.isdir(found):  # False for names that no file can have
            return place
    raise _unknown(kind, name, folder)


def _unknown(kind: str, name: str, folder: Path) -> ConfigError:
    known = sorted(p.stem for p in folder.glob("*") if not p.name.startswith("."))
    close = difflib.get_close_matches(name, known, n=1)
    guess = f", did you mean {close[0]!r}?" if close else ""
    listing = ", ".join(known) if known else "nothing"
    return ConfigError(
        f"no {kind.replace('ies', 'ys').removesuffix('s')} {name!r}{guess}",
        hint=f"give a path, or a name from {folder}: {listing}",
    )


def _candidates() -> Iterator[Path]:
    """Yield possible folders in the order of the search; if the environment variable is set, only its folder."""
    override = os.environ.get(VARIABLE)
    if override:
        yield Path(override)
        return
    code = Path(__file__).resolve().parents[2]
    yield code / "configs"
    yield code / _SHARE
    yield from _installed_files()
    yield Path(sys.prefix) / _SHARE
    yield Path(site.getuserbase()) / _SHARE


@cache
def _installed_files() -> tuple[Path, ...]:
    """Return the folder in the installer's list of files, as a tuple of one; empty if there is no such list."""
    from importlib import metadata  # imported lazily: it is slow, and a source folder does not need it

    try:
        files = metadata.files("omote") or []
    except metadata.PackageNotFoundError:
        return ()
    ending = (_SHARE / "vocabularies").parts
    found = (file for file in files if file.parts[-len(ending) - 1 : -1] == ending)
    return tuple(Path(os.path.abspath(file.locate())).parents[1] for file in found)[:1]
