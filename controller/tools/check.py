"""Checks any file that omote reads: finds out its kind, reads it whole, and describes it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from controller.base.config import load, read_toml
from controller.base.errors import ConfigError
from controller.base.parameters import PARAMETERS, Parameters
from controller.base.paths import config_dir, find_config
from controller.layers.idle.draws import mean_of
from controller.layers.idle.settings import IdleSettings
from controller.layers.settings import load_layers
from controller.links.line.script import load_script
from controller.robot.calibration import CalibrationFile
from controller.robot.fault_script import load_fault_script
from controller.robot.robot import load_robot, robot_parameters
from controller.robot.settings import RobotSettings
from controller.stage.persons import WORN, load_person
from controller.stage.stage import Stage, check_identity, heads_of, load_stage
from controller.stage.study import load_study
from controller.takes.reader import load_take, suffixes
from controller.takes.recording import SUFFIX, replay
from controller.takes.retarget import load_ranges
from controller.tools import file_kinds
from controller.tools.robot_warnings import robot_warnings
from controller.tools.traffic_files import describe_traffic
from controller.vocabulary.affect import Affect
from controller.vocabulary.controls import load_controls
from controller.vocabulary.facs import Facs
from controller.vocabulary.presets import Presets
from controller.vocabulary.visemes import Visemes
from controller.vocabulary.vocabulary import Vocabulary
from drivers.base.permission import ports_forbidden
from surface.base.errors import SurfaceFileError
from surface.base.files import read_text
from surface.readers import is_plain, read_surface, summary

DEFAULT_HEAD = "ict"
SURFACE_SUFFIXES = (".3dm", ".xml", ".tsm")
MESHES = (".glb", ".gltf", ".vrm", ".obj", ".ply", ".stl", ".off")
TRAFFIC = (".pcapng", ".log")


@dataclass(frozen=True)
class _Known:
    """What a file may refer to: ``parameters``, the shipped expressions, and those of the files ``more``."""

    parameters: Parameters
    more: tuple[Path, ...] = ()

    def vocabulary(self, *more: Path) -> Vocabulary:
        """Return all these expressions, with those of further files."""
        return Vocabulary.load(self.parameters.with_files(more), more=(*self.more, *more))


def check_anything(name: str, vocabularies: Sequence[Path] = ()) -> list[str]:
    """Check any file that omote reads; return lines that describe it.

    ``name`` : a path, or the name of a shipped stage, robot, head or other file of configs. ``vocabularies`` : files
    with expressions and parameters that it may refer to.

    Raises ConfigError or SurfaceError: the file cannot be read or is wrong.
    """
    with ports_forbidden("a check"):
        path = _find(name)
        more = tuple(each for each in vocabularies if each.resolve() != path.resolve())
        known = _Known(PARAMETERS.with_files(more), more)
        return [f"{line}: good" if not line.startswith(" ") else line for line in _describe(path, known)]


def _find(name: str) -> Path:
    if os.path.exists(name):
        return Path(name)
    for kind in ("stages", "robots", "heads", "scripts", "vocabularies", "life", "persons", "controls"):
        try:
            return find_config(kind, name)
        except ConfigError:
            continue
    hint = "omote check demo"
    raise ConfigError(
        f"{name}: no such file, and no stage, robot, head, script, vocabulary, life, person or controls of that name",
        hint=hint,
    )


def _describe(path: Path, known: _Known) -> Iterator[str]:
    """Yield lines that describe a file; one that begins with a space adds to the line before it."""
    suffix = path.suffix.lower()
    if _is_head(path):
        yield from _check_head(path if path.is_dir() else path.parent)
    elif suffix == ".json" and _is_group(path):
        yield _check_group(path)
    elif suffix in SURFACE_SUFFIXES or (suffix == ".json" and is_plain(path)):  # .json is speech, too
        left_out: list[SurfaceFileError] = []
        for item in read_surface(path, left_out.append):
            yield f"surface {summary(item)}"
        for error in left_out:
            yield f"  left out: {error}"
    elif path.suffix == SUFFIX:  # replayed as fast as possible; every tick must reproduce the recorded values
        times = [now_ns for now_ns, _ in replay(path, known.parameters)]
        seconds = (times[-1] - times[0]) * 1e-9 if times else 0.0
        yield f"recording {path.name}: {len(times)} ticks, {seconds:.1f} s, all reproduced exactly"
    elif suffix in TRAFFIC:
        yield describe_traffic(path)
    elif suffix in suffixes():
        take = load_take(path, known.parameters)
        yield f"take {path.name}: {take.frames} frames, {take.duration_s:.1f} s at {take.rate_hz:.0f} Hz"
    elif suffix in MESHES:
        why = f"{path}: is a mesh; omote check checks the head that is made from it"
        raise ConfigError(why, hint=f"omote fit {path} -o HEAD; omote check HEAD")
    else:
        yield from _describe_toml(path, known)


def _is_head(path: Path) -> bool:
    """Whether a path is a head's folder or its head.toml; a robot file may be called head.toml, too."""
    if path.name != "head.toml" or path.is_dir():
        return path.is_dir()
    try:
        return not {"buses", "channels"} & set(read_toml(path))
    except ConfigError:
        return True  # the reader of heads reports the fault in detail


def _check_head(folder: Path) -> Iterator[str]:
    """Check the head at rest and with every parameter at its limit.

    Raises ConfigError: the head has defects, one line each, or cannot be posed.
    """
    from surface.check import check_head  # imported lazily: only heads need it
    from surface.head import Head  # imported lazily: only heads and groups need it
    from surface.head.model.data import GREATEST_ERROR  # imported lazily: as above
    from surface.head.model.identity import load_identities, with_identities  # imported lazily: as above

    head = Head.load(folder)
    known = load_identities(folder)
    for name in known:
        with_identities(head.data, known, {name: 1.0}, str(folder))
    try:
        found = check_head(head)
    except (ArithmeticError, LookupError, ValueError) as error:
        raise ConfigError(f"{folder}: cannot be posed: {error}", hint="make the head again: omote fit") from error
    if defects := [f.line(str(folder)) for f in found if not f.warning]:
        raise ConfigError("\n".join(f"{folder}: {line}" for line in defects))
    vertices = sum(len(part.vertices) for part in head.parts)
    yield f"head {head.name}: {len(head.parts)} parts, {vertices} vertices, {len(head.parameters)} parameters"
    if said := head.data.provenance.get(GREATEST_ERROR):
        yield f"  when it was fitted: greatest error {said}"
    yield from (f"  warning: {f.line(str(folder))}" for f in found)


def _is_group(path: Path) -> bool:
    try:
        return '"moves_mm"' in read_text(path)
    except (OSError, ValueError):
        return False


def _check_group(path: Path) -> str:
    from controller.stage.inverse import load_group  # imported lazily: only heads and groups need it
    from surface.head.model.file import load_data  # imported lazily: only heads and groups need it

    head = load_data(find_config("heads", DEFAULT_HEAD))
    name, group = load_group(path, head)
    return f"group {name}: {len(group.ids)} control points of part {group.part} of head {head.name}"


def _describe_toml(path: Path, known: _Known) -> Iterator[str]:
    table = read_toml(path)
    kind = file_kinds.kind_of(table)
    if kind is None and table:
        why = f"no kind of file has the keys {', '.join(table)[:200]}"
        raise ConfigError(f"{path}: {why}", hint="compare it with a file of the same kind in omote's folder configs")
    yield from _READERS.get(kind or file_kinds.STAGE, _describe_stage)(path, known)


def _describe_calibration(path: Path, known: _Known) -> Iterator[str]:
    found = load(path, CalibrationFile)
    yield f"calibration {found.name} of robot {found.robot}: {len(found.channels)} channels"


def _describe_script(path: Path, known: _Known) -> Iterator[str]:
    script = load_script(str(path), known.parameters, known.vocabulary())
    yield f"script {script.name}: {len(script.steps)} steps, {len(script.marks)} marks"


def _describe_faults(path: Path, known: _Known) -> Iterator[str]:
    timeline = load_fault_script(path)
    loop = f", again every {timeline.loop_s:g} s" if timeline.loop_s else ""
    yield f"timeline of faults {path.name}: {len(timeline.steps)} entries{loop}"


def _describe_expressions(path: Path, known: _Known) -> Iterator[str]:
    shipped = config_dir() / "vocabularies" / "expressions.toml"
    more = () if path.resolve() == shipped.resolve() else (path,)
    before = len(known.vocabulary().names) if more else 0
    names = known.parameters.with_files(more).own[len(known.parameters.own) :]
    own = f", parameters of its own: {', '.join(names)}" if names else ""
    yield f"expressions {path.name}: {len(known.vocabulary(*more).names) - before}{own}"


def _describe_life(path: Path, known: _Known) -> Iterator[str]:
    settings = IdleSettings.named(str(path), known.parameters)
    poses = sum(len(each.poses) for each in (settings.fidget, settings.smile, settings.swallow))
    yield f"life {path.name}: a blink every {mean_of(settings.blink.interval_s):g} s on average, {poses} gestures"


def _describe_person(path: Path, known: _Known) -> Iterator[str]:
    person = load_person(path).settings
    check_identity(find_config("heads", DEFAULT_HEAD), person.identity)
    mix = ", ".join(f"{name} {amount:g}" for name, amount in person.identity.items()) or "the head's own"
    yield f"person {person.name}: identity {mix}; melanin {person.skin.melanin:g}"
    worn = ", ".join(f"{kind} {each.style}" for kind in WORN if (each := getattr(person, kind)) is not None)
    yield f"  wears {worn or 'nothing'}"


def _describe_parameters(path: Path, known: _Known) -> Iterator[str]:
    """Describe a base vocabulary, which has the shipped names, or one that adds parameters and perhaps expressions."""
    named = read_toml(path).get("parameters")
    if isinstance(named, Mapping) and set(PARAMETERS.names) & set(named):
        yield f"parameters {path.name}: {len(Parameters.load(path))}"
    else:
        yield from _describe_expressions(path, known)


def _describe_units(path: Path, known: _Known) -> Iterator[str]:
    found = Facs.load(known.parameters, path)
    yield f"action units {path.name}: {len(found.names)} with sides, {len(found.emotions)} emotions"


def _describe_visemes(path: Path, known: _Known) -> Iterator[str]:
    found = Visemes.load(known.parameters, path)
    yield f"visemes {path.name}: {len(found.names)}, {len(found.phonemes)} phonemes"


def _describe_presets(path: Path, known: _Known) -> Iterator[str]:
    yield f"presets {path.name}: {len(Presets.load(known.parameters, path).names)}"


def _describe_controls(path: Path, known: _Known) -> Iterator[str]:
    found = load_controls(path, known.parameters, known.vocabulary())
    counts = (f"{len(getattr(found, table))} {table}" for table in ("controllers", "axes", "buttons", "keys"))
    yield f"controls {path.name}: {', '.join(text for text in counts if not text.startswith('0 ')) or 'nothing'}"


def _describe_ranges(path: Path, known: _Known) -> Iterator[str]:
    parameters = known.parameters
    low, high = load_ranges(path, parameters)
    yield f"ranges {path.name}: of {int(((low != parameters.low) | (high != parameters.high)).sum())} parameters"


def _describe_study(path: Path, known: _Known) -> Iterator[str]:
    study = load_study(path, known.parameters)
    conditions = len(study.settings.conditions)
    yield f"study {study.settings.name}: {len(study.trials)} trials of {conditions} conditions, {study.length_s:.0f} s"


def _describe_moods(path: Path, known: _Known) -> Iterator[str]:
    yield f"moods {path.name}: {len(Affect.load(known.vocabulary(), path).names) - 1} anchors"


def _describe_layers(path: Path, known: _Known) -> Iterator[str]:
    yield f"layers {path.name}: {', '.join(layer.name for layer in load_layers(base=path))}"


def _describe_stage(path: Path, known: _Known) -> Iterator[str]:
    stage = load_stage(str(path), PARAMETERS, known.more)
    if stage.groups:
        stage.load_head()
    name = f"stage {stage.settings.name}"
    if stage.heads:
        yield f"{name}: heads {', '.join(head.name for head in stage.heads)}"
    else:
        yield f"{name}: {_stage_parts(stage)}"
    for head in stage.heads:
        yield f"head {head.name}: {_stage_parts(head.stage)}"
    for each in heads_of(stage):
        yield from _warnings(each.robots)


def _stage_parts(stage: Stage) -> str:
    links = ", ".join(map(str, stage.settings.links)) or "none"
    robots = ", ".join(robot.name for robot in stage.robots) or "none"
    own = f", parameters of its own: {', '.join(stage.parameters.own)}" if stage.parameters.own else ""
    return f"head {stage.head.name}, links: {links}, robots: {robots}{own}"


def _warnings(robots: Sequence[RobotSettings]) -> Iterator[str]:
    yield from (f"  warning: {line}" for line in robot_warnings(robots))


def _describe_robot(path: Path, known: _Known) -> Iterator[str]:
    """Describe a robot. If it has anchors (servos that pull the skin), also how far its servos fall short.

    For each region, the lines give how far emotions move the skin, and the part that servos miss (rms, mm).
    """
    robot = load_robot(path, known.parameters)
    parameters = robot_parameters(robot, path, known.parameters)
    yield f"robot {robot.name}: {len(robot.buses)} buses, {len(robot.channels)} channels"
    yield from _warnings([robot])
    if not robot.anchored_channels:
        return
    from controller.robot.anchors import load_anchors, residual_rows  # imported lazily: for anchors
    from controller.robot.suggest_servos import described, suggest_servos  # imported lazily: for anchors

    anchors = load_anchors(robot, find_config("heads", DEFAULT_HEAD), parameters, where=str(path))
    vocabulary = Vocabulary.load(parameters, more=known.more)
    emotions = {n: vocabulary[n].weights for n in vocabulary.names if vocabulary[n].kind == "emotion"}
    if anchors is None:
        return
    for region, wanted, residual in residual_rows(anchors, emotions, parameters):
        yield f"  {region}: emotions move it {wanted:.1f} mm, the servos fall {residual:.1f} mm short (rms)"
    yield from (f"  {described(found)}" for found in suggest_servos(anchors, emotions, parameters))


_READERS: dict[file_kinds.FileKind, Callable[[Path, _Known], Iterator[str]]] = {
    file_kinds.STAGE: _describe_stage,
    file_kinds.ROBOT: _describe_robot,
    file_kinds.CALIBRATION: _describe_calibration,
    file_kinds.PERSON: _describe_person,
    file_kinds.SCRIPT: _describe_script,
    file_kinds.FAULTS: _describe_faults,
    file_kinds.LIFE: _describe_life,
    file_kinds.PARAMETERS: _describe_parameters,
    file_kinds.UNITS: _describe_units,
    file_kinds.VISEMES: _describe_visemes,
    file_kinds.PRESETS: _describe_presets,
    file_kinds.CONTROLS: _describe_controls,
    file_kinds.RANGES: _describe_ranges,
    file_kinds.STUDY: _describe_study,
    file_kinds.MOODS: _describe_moods,
    file_kinds.LAYERS: _describe_layers,
    file_kinds.EXPRESSIONS: _describe_expressions,
}
