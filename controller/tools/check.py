"""Finding out what a file is and checking it whole."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from controller.base.config import load
from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS, Parameters
from controller.base.paths import config_dir, find_config
from controller.links.line.script import load_script
from controller.robot.calibration import CalibrationFile
from controller.robot.robot import load_robot
from controller.robot.settings import RobotSettings
from controller.stage.stage import load_stage
from controller.takes.reader import load_take, suffixes
from controller.takes.recording import SUFFIX, replay
from controller.vocabulary.vocabulary import Vocabulary
from surface.readers import is_plain, read_surface, summary

if TYPE_CHECKING:
    from surface.head import Head  # start-up: only heads and groups need it


DEFAULT_HEAD = "ict"
SURFACE_SUFFIXES = (".3dm", ".xml", ".tsm")


def check_anything(name: str) -> list[str]:
    """Check any file omote reads; returns what it is, in a line or two.

    Parameters
    ----------
    name : a path, or the name of a shipped stage, robot or head.

    Raises
    ------
    ConfigError, SurfaceError
        listing every fault.
    """
    path = _find(name)
    if path.is_dir() or path.name == "head.toml":
        return _check_head(path if path.is_dir() else path.parent)
    if _is_group(path):
        return _check_group(path)
    if _is_surface(path):
        return _check_surface(path)
    if path.suffix == SUFFIX:
        return _check_recording(path)
    if path.suffix.lower() in suffixes():
        return _check_take(path)
    return _check_toml(path)


def _find(name: str) -> Path:
    if Path(name).exists():
        return Path(name)
    for kind in ("stages", "robots", "heads"):
        try:
            return find_config(kind, name)
        except ConfigError:
            continue
    raise ConfigError(f"{name}: no such file, and no stage, robot or head of that name", hint="omote check demo")


def _check_head(folder: Path) -> list[str]:
    from surface.head import Head  # start-up: only heads and groups need it

    head = Head.load(folder)
    _check_poses(head, folder)
    vertices = sum(len(part.vertices) for part in head.parts)
    return [f"head {head.name}: {len(head.parts)} parts, {vertices} vertices, {len(head.parameters)} parameters: good"]


def _check_poses(head: Head, folder: Path) -> None:
    """Every parameter alone at its end must leave every vertex where it can be drawn."""
    for index, name in enumerate(head.parameters):
        values = np.zeros(len(head.parameters))
        values[index] = 1.0
        head.pose(values)
        bad = [part.name for part in head.parts if not np.isfinite(part.vertices).all()]
        if bad:
            raise ConfigError(f"{folder}: {name} = 1 throws vertices of {', '.join(bad)} out of space")


def _is_surface(path: Path) -> bool:
    """By suffix; .json is speech, too, and says by its keys which it is."""
    kind = path.suffix.lower()
    if kind == ".json":
        return is_plain(path)
    return kind in SURFACE_SUFFIXES


def _is_group(path: Path) -> bool:
    """A JSON file that says control points and their moves."""
    try:
        return path.suffix.lower() == ".json" and '"moves_mm"' in path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return False


def _check_group(path: Path) -> list[str]:
    from controller.stage.inverse import load_group  # start-up: as Head
    from surface.head import Head  # start-up: only heads and groups need it

    head = Head.load(find_config("heads", DEFAULT_HEAD))
    name, shape = load_group(path, head)
    return [f"group {name}: {len(shape.ids)} control points of part {shape.part} of head {head.name}: good"]


def _check_recording(path: Path) -> list[str]:
    """Play it again, as fast as it goes; every tick has to come out as it was recorded."""
    times = [now_ns for now_ns, _ in replay(path, PARAMETERS)]
    seconds = (times[-1] - times[0]) * 1e-9 if times else 0.0
    return [f"recording {path.name}: {len(times)} ticks, {seconds:.1f} s, all came out again bit by bit: good"]


def _check_surface(path: Path) -> list[str]:
    return [f"surface {summary(item)}: good" for item in read_surface(path)]


def _check_take(path: Path) -> list[str]:
    take = load_take(path, PARAMETERS)
    return [f"take {path.name}: {take.frames} frames, {take.duration_s:.1f} s at {take.rate_hz:.0f} Hz: good"]


def _check_toml(path: Path) -> list[str]:
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        table = {}  # the reader below says what is wrong
    if isinstance(table.get("channels"), dict) and "buses" not in table:
        return _check_calibration(path)
    if "channels" in table or "buses" in table:
        return _check_robot(path, PARAMETERS)
    if "steps" in table or "frames_hz" in table:
        script = load_script(str(path), PARAMETERS)
        return [f"script {script.name}: {len(script.steps)} steps, {len(script.marks)} marks: good"]
    if table and all(isinstance(each, dict) and {"weights", "of"} & set(each) for each in table.values()):
        return _check_expressions(path)
    return _check_stage(path, PARAMETERS)


def _check_calibration(path: Path) -> list[str]:
    found = load(path, CalibrationFile)
    return [f"calibration {found.name} of robot {found.robot}: {len(found.channels)} channels: good"]


def _check_expressions(path: Path) -> list[str]:
    """A user's expressions beside the shipped ones; or the shipped file itself."""
    shipped = config_dir() / "vocabularies" / "expressions.toml"
    more = () if path.resolve() == shipped.resolve() else (path,)
    known = len(Vocabulary.load(PARAMETERS).names) if more else 0
    return [f"expressions {path.name}: {len(Vocabulary.load(PARAMETERS, more=more).names) - known}: good"]


def _check_robot(path: Path, parameters: Parameters) -> list[str]:
    robot = load_robot(path, parameters)
    lines = [f"robot {robot.name}: {len(robot.buses)} buses, {len(robot.channels)} channels: good"]
    return lines + _what_it_cannot_show(path, robot, parameters)


def _what_it_cannot_show(path: Path, robot: RobotSettings, parameters: Parameters) -> list[str]:
    """For a robot with anchors: the emotions' motion by region, and how much of it is left over (rms, mm)."""
    if all(channel.anchor is None for channel in robot.channels):
        return []
    from controller.robot.anchors import load_anchors, residual_rows  # start-up: as Head

    anchors = load_anchors(robot, find_config("heads", DEFAULT_HEAD), parameters, where=str(path))
    vocabulary = Vocabulary.load(parameters)
    emotions = {n: vocabulary[n].weights for n in vocabulary.names if vocabulary[n].kind == "emotion"}
    found = residual_rows(anchors, emotions, parameters) if anchors is not None else ()
    return [f"  {region}: emotions move it {wanted:.1f} mm, the servos stay {left:.1f} mm behind (rms)"
            for region, wanted, left in found]  # fmt: skip


def _check_stage(path: Path, parameters: Parameters) -> list[str]:
    stage = load_stage(str(path), parameters)
    if stage.groups:
        stage.load_head()
    links = ", ".join(map(str, stage.settings.links)) or "none"
    robots = ", ".join(robot.name for robot in stage.robots) or "none"
    return [f"stage {stage.settings.name}: head {stage.head.name}, links: {links}, robots: {robots}: good"]
