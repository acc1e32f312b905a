"""What happens with a file that is dropped on the window: a head or mesh is shown, a take played, a stage opened.

Independent of the window library.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from controller.base.errors import ConfigError, ControllerError
from controller.base.parameters import PARAMETERS
from controller.body.messages import PanelRequest, PlayTake
from controller.panels.session.jobs import Job, Jobs, run_program
from controller.panels.session.look import Look
from controller.panels.session.problems import Problems
from controller.panels.window.looks import Looks
from controller.stage.persons import PersonSettings, load_person
from controller.stage.stage import load_stage
from controller.takes.reader import load_take, suffixes
from surface.base.files import read_toml, reading

if TYPE_CHECKING:
    from controller.panels.session.commands import Commands

MESHES = (".glb", ".gltf", ".vrm", ".obj")
_HEAD = "head.toml"
_HINT = "drop a head's folder, a stage, a person, a take, or a mesh (.glb, .vrm, .obj)"
_OMOTE = (sys.executable, "-c", "from controller.cli import main; main()")


class Drops:
    """Takes files.

    send : sends requests to the body. folder : heads made of meshes are written there.
    restart : called with the file of another stage, which the run goes on with.
    """

    def __init__(
        self, looks: Looks, commands: Commands, jobs: Jobs, problems: Problems,
        send: Callable[[PanelRequest], None], folder: Path, restart: Callable[[Path], None],
    ) -> None:  # fmt: skip
        self._looks, self._commands, self._jobs, self._problems = looks, commands, jobs, problems
        self._send, self._folder, self._restart = send, folder, restart

    def __call__(self, paths: Sequence[Path]) -> None:
        """Take them one after the other; what cannot be used is reported, with what could be."""
        for path in paths:
            try:
                self._take(path)
            except Exception as error:  # noqa: BLE001  the window goes on
                self._problems.add(error)

    def _take(self, path: Path) -> None:
        suffix = path.suffix.lower()
        if path.is_dir() or path.name == _HEAD:
            self._show_head(path if path.is_dir() else path.parent)
        elif suffix == ".toml":
            self._take_toml(path)
        elif suffix in MESHES:
            self._fit(path)
        elif suffix in suffixes():
            self._jobs.start(
                f"reading {path.name}",
                lambda _: load_take(path, self._looks.stage.parameters),
                lambda _: self._play(path),
            )
        else:
            raise ControllerError(f"{path}: nothing here reads such files", hint=_HINT)

    def _play(self, path: Path) -> None:
        self._send(PlayTake(path))

    def _show_head(self, folder: Path) -> None:
        if not (folder / _HEAD).is_file():
            raise ConfigError(f"{folder}: the folder is no head: there is no {_HEAD} in it", hint=_HINT)
        self._appear(head=folder, person="")

    def _appear(self, **change: Any) -> None:
        look: Look = self._commands.now.look or self._looks.first
        self._commands.set_look(replace(look, **change))

    def _take_toml(self, path: Path) -> None:
        with reading(path, ConfigError):
            table = read_toml(path)
        if is_person(table):
            load_person(path)
            self._appear(person=str(path))
        elif "steps" in table:
            raise ControllerError(
                f"{path}: a script plays from the folder of its stage",
                hint=f"copy it to {self._looks.stage.path.parent}; then it is a button under shows",
            )
        else:
            load_stage(str(path), PARAMETERS)
            self._restart(path)

    def _fit(self, path: Path) -> None:
        """Make a head of a mesh, in a program of its own, and show it."""
        out = free_folder(self._folder, path.stem)

        def work(job: Job) -> Path:
            run_program(job, [*_OMOTE, "fit", str(path), "-o", str(out)])
            return out

        self._jobs.start(f"fitting {path.name}", work, self._show_head)


def is_person(table: Mapping[str, Any]) -> bool:
    """Whether a table is a person's: all its keys are, and one of them that no stage has."""
    own = set(PersonSettings.model_fields)
    return set(table) <= own and bool(set(table) & (own - {"name", "description", "identity"}))


def free_folder(beside: Path, stem: str) -> Path:
    """Return the first name with a number that nothing has."""
    number = 1
    while (path := beside / f"{stem}-head{number}").exists():
        number += 1
    return path
