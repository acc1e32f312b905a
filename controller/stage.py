"""A stage: one head, the links that command it and the robots that make the same face."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from controller.config import Settings, config_error, load
from controller.errors import ConfigError
from controller.host import load_script
from controller.parameters import Parameters
from controller.paths import find_config
from controller.robot import RobotSettings, load_robot

Pixels = Annotated[int, Field(ge=16, le=16384)]


class FaceSettings(Settings):
    """How the picture is drawn."""

    size: tuple[Pixels, Pixels] = (1280, 720)
    fps: Annotated[float, Field(ge=1, le=1000)] = 60.0
    quality: Literal["full", "fast"] = "full"
    camera: Literal["front", "three_quarter", "profile"] = "front"


class LinkSettings(Settings):
    """One way commands come in. ``simulated`` starts the simulated robot host with ``script``."""

    kind: Literal["line"] = "line"
    port: str
    baud: Annotated[int, Field(ge=300, le=12_000_000)] = 115_200
    script: str | None = None

    @model_validator(mode="after")
    def _script_is_simulated(self) -> LinkSettings:
        if self.script is not None and self.port != "simulated":
            raise ValueError('script needs port = "simulated"')
        return self


class StageSettings(Settings):
    """What a stage file holds."""

    name: str
    description: str = ""
    head: str = "ict"
    robots: list[str] = []
    control_hz: Annotated[float, Field(ge=10, le=1000)] = 100.0
    liveliness: Annotated[float, Field(ge=0, le=1)] = 0.0
    face: FaceSettings = FaceSettings()
    links: list[LinkSettings] = []


@dataclass(frozen=True)
class Stage:
    """A stage with everything it refers to found and checked.

    Attributes
    ----------
    path : the stage's file.
    settings : its content.
    head : folder of the head.
    robots : the robots, in file order.
    """

    path: Path
    settings: StageSettings
    head: Path
    robots: tuple[RobotSettings, ...]


def load_stage(name: str, parameters: Parameters) -> Stage:
    """Find, read and cross-check a stage and all it refers to.

    Parameters
    ----------
    name : a path, or the name of a file in ``configs/stages``.

    Raises
    ------
    ConfigError
        listing every fault of the stage and of the files it names.
    """
    path = find_config("stages", name)
    settings = load(path, StageSettings)
    faults: list[str] = []
    head = _collect(faults, "head", lambda: find_config("heads", settings.head, beside=path))
    robots = [
        _collect(
            faults,
            f"robots[{i}]",
            lambda robot=robot: load_robot(find_config("robots", robot, beside=path), parameters),
        )
        for i, robot in enumerate(settings.robots)
    ]
    for i, link in enumerate(settings.links):
        if link.script is not None:
            _collect(faults, f"links[{i}].script", lambda name=link.script: load_script(name, parameters))
    if faults:
        raise config_error(path, faults)
    return Stage(path, settings, head, tuple(robots))


def _collect(faults: list[str], key: str, read):  # type: ignore[no-untyped-def]
    """Run ``read``; a configuration error becomes a fault of ``key``, so that all are seen at once."""
    try:
        return read()
    except ConfigError as error:
        hint = f" ({error.hint})" if error.hint and "\n" not in str(error) else ""
        faults.append(f"{key}: {error}{hint}".replace("\n", "\n  "))
        return None
