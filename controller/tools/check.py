"""Checks any file omote reads: finds out what it is, reads it whole, and describes it."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from controller.base.config import load
from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS
from controller.base.paths import config_dir, find_config
from controller.links.line.script import load_script
from controller.robot.calibration import CalibrationFile
from controller.robot.robot import load_robot
from controller.stage.stage import load_stage
from controller.takes.reader import load_take, suffixes
from controller.takes.recording import SUFFIX, replay
from controller.vocabulary.vocabulary import Vocabulary
from drivers.base.permission import ports_forbidden
from surface.readers import is_plain, read_surface, summary

DEFAULT_HEAD = "ict"
SURFACE_SUFFIXES = (".3dm", ".xml", ".tsm")


def check_anything(name: str) -> list[str]:
    """Check any file omote reads; returns what it is, in a line or two.

    ``name`` : a path, or the name of a shipped stage, robot or head. Raises ConfigError or SurfaceError.
    """
    with ports_forbidden("a check"):
        return [f"{line}: good" if not line.startswith(" ") else line for line in _describe(_find(name))]


def _find(name: str) -> Path:
    if Path(name).exists():
        return Path(name)
    for kind in ("stages", "robots", "heads"):
        try:
            return find_config(kind, name)
        except ConfigError:
            continue
    raise ConfigError(f"{name}: no such file, and no stage, robot or head of that name", hint="omote check demo")


def _describe(path: Path) -> Iterator[str]:
    """Lines on a file; one that begins with a space continues the line before it."""
    suffix = path.suffix.lower()
    if path.is_dir() or path.name == "head.toml":
        yield _check_head(path if path.is_dir() else path.parent)
    elif suffix == ".json" and _is_group(path):
        yield _check_group(path)
    elif suffix in SURFACE_SUFFIXES or (suffix == ".json" and is_plain(path)):  # .json is speech, too
        for item in read_surface(path):
            yield f"surface {summary(item)}"
    elif path.suffix == SUFFIX:  # replayed as fast as possible; every tick has to give the recorded values
        times = [now_ns for now_ns, _ in replay(path, PARAMETERS)]
        seconds = (times[-1] - times[0]) * 1e-9 if times else 0.0
        yield f"recording {path.name}: {len(times)} ticks, {seconds:.1f} s, all came out again bit by bit"
    elif suffix in suffixes():
        take = load_take(path, PARAMETERS)
        yield f"take {path.name}: {take.frames} frames, {take.duration_s:.1f} s at {take.rate_hz:.0f} Hz"
    else:
        yield from _describe_toml(path)


def _check_head(folder: Path) -> str:
    """Pose every parameter alone at its end: every vertex must be finite."""
    from surface.head import Head  # start-up: only heads and groups need it

    head = Head.load(folder)
    for name in head.parameters:
        head.pose(head.values({name: 1.0}))
        bad = [part.name for part in head.parts if not np.isfinite(part.vertices).all()]
        if bad:
            raise ConfigError(f"{folder}: {name} = 1 throws vertices of {', '.join(bad)} out of space")
    vertices = sum(len(part.vertices) for part in head.parts)
    return f"head {head.name}: {len(head.parts)} parts, {vertices} vertices, {len(head.parameters)} parameters"


def _is_group(path: Path) -> bool:
    try:
        return '"moves_mm"' in path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return False


def _check_group(path: Path) -> str:
    from controller.stage.inverse import load_group  # start-up: as Head
    from surface.head import Head  # start-up: only heads and groups need it

    head = Head.load(find_config("heads", DEFAULT_HEAD))
    name, group = load_group(path, head)
    return f"group {name}: {len(group.ids)} control points of part {group.part} of head {head.name}"


def _describe_toml(path: Path) -> Iterator[str]:
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        table = {}  # the reader below reports what is wrong
    if isinstance(table.get("channels"), dict) and "buses" not in table:
        found = load(path, CalibrationFile)
        yield f"calibration {found.name} of robot {found.robot}: {len(found.channels)} channels"
    elif "channels" in table or "buses" in table:
        yield from _describe_robot(path)
    elif "steps" in table or "frames_hz" in table:
        script = load_script(str(path), PARAMETERS)
        yield f"script {script.name}: {len(script.steps)} steps, {len(script.marks)} marks"
    elif table and all(isinstance(each, dict) and {"weights", "of"} & set(each) for each in table.values()):
        shipped = config_dir() / "vocabularies" / "expressions.toml"
        more = () if path.resolve() == shipped.resolve() else (path,)
        known = len(Vocabulary.load(PARAMETERS).names) if more else 0
        yield f"expressions {path.name}: {len(Vocabulary.load(PARAMETERS, more=more).names) - known}"
    else:
        stage = load_stage(str(path), PARAMETERS)
        if stage.groups:
            stage.load_head()
        links = ", ".join(map(str, stage.settings.links)) or "none"
        robots = ", ".join(robot.name for robot in stage.robots) or "none"
        yield f"stage {stage.settings.name}: head {stage.head.name}, links: {links}, robots: {robots}"


def _describe_robot(path: Path) -> Iterator[str]:
    """A robot; with anchors, by region how far emotions move the skin and the servos fall short (rms, mm)."""
    robot = load_robot(path, PARAMETERS)
    yield f"robot {robot.name}: {len(robot.buses)} buses, {len(robot.channels)} channels"
    if not robot.anchored_channels:
        return
    from controller.robot.anchors import load_anchors, residual_rows  # start-up: as Head

    anchors = load_anchors(robot, find_config("heads", DEFAULT_HEAD), PARAMETERS, where=str(path))
    vocabulary = Vocabulary.load(PARAMETERS)
    emotions = {n: vocabulary[n].weights for n in vocabulary.names if vocabulary[n].kind == "emotion"}
    for region, wanted, left in residual_rows(anchors, emotions, PARAMETERS) if anchors is not None else ():
        yield f"  {region}: emotions move it {wanted:.1f} mm, the servos stay {left:.1f} mm behind (rms)"
