"""Reads stage files, which tie together one or more heads, the links that command them, and the robots that follow."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from controller.base.config import Settings, read_toml
from controller.base.config import check as check_table
from controller.base.errors import ConfigError, ParameterError, TakeError
from controller.base.parameters import Parameters, PointGroup, did_you_mean
from controller.base.paths import find_config
from controller.base.placement import Placement
from controller.layers.commands import CommandState
from controller.layers.idle.settings import IdleSettings
from controller.layers.mixer import LayerSettings
from controller.layers.settings import load_layers
from controller.links.line.script import load_script
from controller.links.links import LinkSettings, LinkTable
from controller.robot.robot import load_robot, robot_parameters
from controller.robot.settings import RobotSettings
from controller.stage.heads import MAX_HEADS, HeadSettings, Names, head_faults, own_settings
from controller.stage.persons import Person, PersonName, mixed_identity, mixed_look, read_persons
from controller.stage.picture import PictureSettings, with_options
from controller.stage.zenoh import ZenohSettings
from controller.takes.reader import load_take
from controller.vocabulary.controls import ControlsFile, load_controls
from controller.vocabulary.vocabulary import Vocabulary

if TYPE_CHECKING:
    from surface.head import Head  # imported lazily: the body draws nothing
    from surface.head.model.light import LightPoints  # imported lazily: as above

Pixels = Annotated[int, Field(ge=16, le=16384)]


class FaceSettings(PictureSettings):
    """The table ``[face]``: settings of the picture, its size and rate, and files of controls."""

    size: tuple[Pixels, Pixels] = (1280, 720)
    fps: Annotated[float, Field(ge=1, le=1000)] = 60.0
    controls: Annotated[list[str], Field(max_length=8)] = []


IDENTITY_HINT = "--identity broad=0.6,young=0.4"


def parse_identity(text: str | None) -> dict[str, float]:
    """Convert ``broad=0.6,young=0.4`` of the command line to amounts by name; a name without amount means 1.

    Raises ParameterError: a word is not NAME=AMOUNT, or an amount is not from 0 to 1.
    """
    identity: dict[str, float] = {}
    for word in (text or "").split(","):
        name, equals, amount = (x.strip() for x in word.partition("="))
        if not word.strip():
            continue
        where = f"--identity {word.strip()}"
        try:
            identity[name] = float(amount) if equals else 1.0
        except ValueError as error:
            raise ParameterError(f"{where}: {amount!r} is not a number", hint=IDENTITY_HINT) from error
        if not name or not 0.0 <= identity[name] <= 1.0:
            raise ParameterError(f"{where}: expected NAME=AMOUNT, 0 to 1", hint=IDENTITY_HINT)
    return identity


def check_identity(head: Path, wanted: Mapping[str, float]) -> None:
    """Raise ConfigError for a variation that the head in folder ``head`` does not have."""
    from surface.head.model.identity import load_identities  # imported lazily: few stages name any

    known = load_identities(head) if wanted else {}
    for name in wanted:
        if name not in known:
            there = ", ".join(known) or "none"
            raise ConfigError(
                f"{head}: no identity {name!r}; there are {there}",
                hint="omote fit --help describes how --identities adds some",
            )


class StageSettings(Settings):
    """The contents of a stage file. ``name`` defaults to the name of the file."""

    name: str
    description: str = ""
    head: str = "ict"
    identity: dict[str, Annotated[float, Field(ge=0, le=1)]] = {}
    robots: Annotated[list[str], Field(max_length=32)] = []
    control_hz: Annotated[float, Field(ge=10, le=1000)] = 100.0
    liveliness: Annotated[float, Field(ge=0, le=1)] = 0.0
    life: str = "natural"
    manner: Literal["auto", "alone", "listen", "speak"] = "auto"
    seed: Annotated[int, Field(ge=0)] = 0
    vocabularies: Annotated[list[str], Field(max_length=64)] = []
    show: str | None = None
    take: str | None = None
    voice: str | None = None
    voice_hz: Annotated[int, Field(ge=1000)] | None = None
    groups: Annotated[dict[str, Annotated[float, Field(ge=-1, le=1)] | Names], Field(max_length=64)] = {}
    layers: Annotated[dict[str, dict[str, Any]], Field(max_length=64)] = {}
    face: FaceSettings = FaceSettings()
    links: Annotated[list[LinkTable], Field(max_length=64)] = []
    heads: Annotated[list[HeadSettings], Field(max_length=MAX_HEADS)] = []
    turns: Literal["manual", "auto"] = "manual"
    zenoh: ZenohSettings | None = None

    @property
    def point_groups(self) -> dict[str, float]:
        """Amounts of the groups of control points that change the head, by file."""
        return {name: value for name, value in self.groups.items() if not isinstance(value, list)}

    @property
    def head_groups(self) -> dict[str, list[str]]:
        """Names of the heads in each group of heads."""
        return {name: value for name, value in self.groups.items() if isinstance(value, list)}


@dataclass(frozen=True)
class Stage:
    """A stage, and everything it refers to, found and checked.

    path : the stage's file. head : folder of its head. vocabulary : named expressions, also those of ``vocabularies``.
    parameters : of the base vocabulary, followed by those that its vocabularies and its robots' vocabularies add.
    layers : the layers. life : settings of idle motion. groups : group files that change the head, with amounts.
    persons : persons that the face shows, with weights. controls : what gamepad and keys do in the window.
    heads : the heads of a stage with ``[[heads]]``, whose other attributes are those of the first head; empty for a
    stage with one head. own_groups : control points that custom parameters move, by the parameter's name.
    """

    path: Path
    settings: StageSettings
    parameters: Parameters
    head: Path
    robots: tuple[RobotSettings, ...]
    vocabularies: tuple[Path, ...]
    vocabulary: Vocabulary
    layers: tuple[LayerSettings, ...]
    life: IdleSettings
    groups: tuple[tuple[Path, float], ...] = ()
    persons: tuple[tuple[Person, float], ...] = ()
    controls: tuple[ControlsFile, ...] = ()
    heads: tuple[StageHead, ...] = ()
    own_groups: Mapping[str, PointGroup] = field(default_factory=dict)

    def file(self, name: str) -> Path:
        """Return the path of a file that the stage names: relative to the stage's folder if it exists there."""
        beside = self.path.parent / name
        return beside if os.path.exists(beside) else Path(name)

    @property
    def period_s(self) -> float:
        """Period of the control loop."""
        return 1.0 / self.settings.control_hz

    def load_head(self, light: Sequence[LightPoints] = ()) -> Head:
        """Load the stage's head with its persons, identity and groups; see :func:`load_head`."""
        dressed = self.settings.face.dressed
        groups, own = self.groups, self.own_groups
        return load_head(self.head, self.settings.identity, groups, self.persons, dressed=dressed, own=own, light=light)

    def state(
        self, parameters: Parameters | None = None, seed: int | None = None, period_s: float | None = None
    ) -> CommandState:
        """Return new layers with the stage's settings and parameters, to which nothing is commanded yet."""
        return CommandState(
            parameters or self.parameters,
            self.vocabulary,
            self.layers,
            life=self.life,
            seed=self.settings.seed if seed is None else seed,
            period_s=period_s or self.period_s,
        )


@dataclass(frozen=True)
class StageHead:
    """One head of a stage that has several. ``stage`` : as if it were the only head."""

    name: str
    stage: Stage
    placement: Placement


def heads_of(stage: Stage) -> tuple[Stage, ...]:
    """Return one stage for each head of a stage; if it has one head, the stage itself."""
    return tuple(head.stage for head in stage.heads) or (stage,)


def load_head(
    folder: Path, identity: Mapping[str, float], groups: Sequence[tuple[Path, float]],
    persons: Sequence[tuple[Person, float]] = (), *, dressed: bool = True,
    own: Mapping[str, PointGroup] = MappingProxyType({}), light: Sequence[LightPoints] = (),
    chord_mm: float | None = None,
) -> Head:  # fmt: skip
    """Load a head with the appearance of ``persons``, and with identities and groups added by their amounts.

    dressed : with hair and clothes. own : control points that custom parameters move.
    light : control points to add after those of the groups. chord_mm : see :meth:`surface.head.Head.load`.

    Raises SurfaceError: the head cannot be read. ConfigError: a group does not fit it.
    """
    # imported lazily: the control process (body) draws nothing
    from controller.stage.inverse import add_group, light_of, placed_groups, read_group
    from surface.head import Head, OwnGroup

    files = [*(path for path, _ in groups), *(group.file for group in own.values())]
    found = [read_group(path)[1] for path in files]
    added = [*light_of(found), *light]
    try:
        look = mixed_look(persons, dressed=dressed)
        head = Head.load(folder, mixed_identity(persons, identity), look, added, chord_mm)
    except ValueError as error:
        hint = "make the group again on this head, or take it out of the stage"
        raise ConfigError(f"{folder}: control points of a group do not fit this head: {error}", hint=hint) from error
    _check_groups(files, head, added)
    placed = placed_groups(found, head.data, light)
    for (_, amount), group in zip(groups, placed, strict=False):
        add_group(head, group, amount)
    named = zip(own.items(), placed[len(groups) :], strict=True)
    head.add_groups([OwnGroup(name, g.part, g.ids, g.moves, each.times) for (name, each), g in named])
    return head


def _check_groups(files: Sequence[Path], head: Head, light: Sequence[LightPoints]) -> None:
    """Raise ConfigError for the first group file that does not fit a head, to which ``light`` was added."""
    from controller.stage.inverse import read_group  # imported lazily: few stages add groups

    added = {part.name: sum(len(each) for each in light if each.part == part.name) for part in head.data.parts}
    counts = {part.name: len(part.points) - added[part.name] for part in head.data.parts}
    for path in files:
        read_group(path, counts)


def with_picture(stage: Stage, wanted: Mapping[str, object]) -> Stage:
    """Return a stage with command-line options in its ``[face]``; see :func:`controller.stage.picture.with_options`."""
    face = with_options(stage.settings.face, wanted)
    same = face.person == stage.settings.face.person  # they have been read with the stage
    persons = stage.persons if same else tuple(find_persons(face.person, stage.head, beside=stage.path))
    heads = tuple(replace(head, stage=with_picture(head.stage, wanted)) for head in stage.heads)
    return replace(stage, persons=persons, settings=stage.settings.model_copy(update={"face": face}), heads=heads)


def find_persons(person: PersonName, head: Path, beside: Path | None = None) -> list[tuple[Person, float]]:
    """Read persons with weights (:func:`controller.stage.persons.read_persons`), and check that they fit a head.

    head : its folder. Raises ConfigError.
    """
    found = read_persons(person, beside)
    for each, _ in found:
        check_identity(head, each.settings.identity)
    return found


def load_stage(name: str, parameters: Parameters, vocabularies: Sequence[Path] = ()) -> Stage:
    """Find, read and check a stage and everything it refers to.

    name : a path, or a file in ``configs/stages``. parameters : of the base vocabulary, to which the stage's
    vocabularies may add. vocabularies : files to add after the stage's own ones.

    Raises ConfigError: lists every fault of the stage and of the files that it names.
    """
    path = find_config("stages", name)
    found: list[Stage] = []

    def check(settings: StageSettings) -> list[str]:
        faults: list[str] = []
        more = [str(each) for each in vocabularies if not _has_vocabulary(settings, path, each)]
        settings = settings.model_copy(update={"vocabularies": [*settings.vocabularies, *more]})
        found[:] = [_gather_all(path, settings, parameters, faults)]
        return faults

    check_table({"name": path.stem, **read_toml(path)}, StageSettings, path, check)
    return found[0]


def _has_vocabulary(settings: StageSettings, path: Path, vocabulary: Path) -> bool:
    """Whether the settings of the stage in ``path`` already name a vocabulary."""
    places = (place for each in settings.vocabularies for place in (path.parent / each, Path(each)))
    return vocabulary.resolve() in (place.resolve() for place in places)


def at_rest(stage: Stage) -> Stage:
    """Return the stage of the first head without links, robots, take, show, voice and idle motion."""
    first = heads_of(stage)[0]
    nothing: dict[str, Any] = {"links": [], "robots": [], "heads": [], "show": None, "take": None, "voice": None}
    return replace(first, robots=(), heads=(), settings=first.settings.model_copy(update=nothing | {"liveliness": 0.0}))


def _layer_faults(links: Sequence[LinkSettings], layers: Sequence[LayerSettings]) -> list[str]:
    """Return faults of links that write an unknown layer, or the layer of another link, which would alternate."""
    faults, names = [], [layer.name for layer in layers]
    writers: dict[str, int] = {}
    for i, link in enumerate(links):
        layer = getattr(link.own, "layer", None) if getattr(link.own, "incoming", None) is not None else None
        if layer is None:
            continue
        if layer not in names:
            faults.append(
                f"links[{i}].layer: unknown layer {layer!r}{did_you_mean(layer, names)}; a new one needs a table, "
                f"[layers.{layer}] with priority = 55"
            )
        elif writers.setdefault(layer, i) != i:
            faults.append(
                f"links[{i}].layer: links[{writers[layer]}] writes {layer} already; give this one its own, as "
                f'layer = "second" with [layers.second] and priority = 55'
            )
    return faults


def _gain_faults(links: Sequence[LinkSettings], regions: Sequence[str]) -> list[str]:
    """Return faults of links with gains of unknown regions."""
    return [
        f"links[{i}].gains: no region called {name!r}{did_you_mean(name, regions)}"
        for i, link in enumerate(links)
        for name in getattr(link.own, "gains", {})
        if name not in regions
    ]


def _load_robot(name: str, beside: Path, parameters: Parameters) -> tuple[RobotSettings, Parameters]:
    """Load a robot; return it, and the parameters with those that its vocabularies add."""
    path = find_config("robots", name, beside=beside)
    robot = load_robot(path, parameters)
    return robot, robot_parameters(robot, path, parameters)


def _gather_all(path: Path, settings: StageSettings, parameters: Parameters, faults: list[str]) -> Stage:
    """Read everything that a stage and its heads refer to; all heads share the parameters of all their vocabularies."""
    faults += head_faults(settings.heads, settings.head_groups)
    if settings.head_groups and not settings.heads:
        faults.append("groups: groups of heads need [[heads]]")
    known: _Known = {}
    if not settings.heads:
        return _gather(path, settings, parameters, _Faults(faults, known))
    common: list[str] = []
    shared = settings.model_copy(update={"heads": [], "robots": [], "links": []})
    parameters = _gather(path, shared, parameters, _Faults(common, known)).parameters
    alone = [settings.model_copy(update=own_settings(dict(settings), head, i)) for i, head in enumerate(settings.heads)]
    for each in alone:
        parameters = _gather(path, each, parameters, _Faults([], known)).parameters
    heads = []
    for i, (head, each) in enumerate(zip(settings.heads, alone, strict=True)):
        own: list[str] = []
        stage = _gather(path, each, parameters, _Faults(own, known))
        heads.append(StageHead(head.name, stage, head.placement(i, len(settings.heads))))
        faults += [f"heads[{i}].{fault.removeprefix('face.')}" for fault in own if fault not in common]
    faults += common
    return replace(heads[0].stage, settings=settings, heads=tuple(heads))


def _gather(path: Path, settings: StageSettings, parameters: Parameters, faults: _Faults) -> Stage:
    """Read everything that a stage refers to. If anything is added to ``faults``, the returned stage is incomplete."""
    read = faults.read
    head = read("head", (settings.head,), lambda: find_config("heads", settings.head, beside=path))
    if head is not None and settings.identity:
        read("identity", (head, settings.identity), lambda: check_identity(head, settings.identity))
    person = settings.face.person
    persons = read("face.person", (head, person), lambda: find_persons(person, head, path)) if head else ()
    more = _files(faults, "vocabularies", settings.vocabularies, path)
    files = parameters.files
    parameters = read("vocabularies", ("parameters", files, more), lambda: parameters.with_files(more)) or parameters
    robots: list[Any] = []
    for i, name in enumerate(settings.robots):
        found = read(f"robots[{i}]", (name, parameters.files), lambda n=name, p=parameters: _load_robot(n, path, p))
        robot, parameters = found or (None, parameters)
        robots.append(robot)
    groups = _files(faults, "groups", list(settings.point_groups), path)
    files = parameters.files
    vocabulary = read("vocabularies", (files, more), lambda: Vocabulary.load(parameters, more=more))
    regions = parameters.region_names
    own = settings.layers
    layers = read("layers", (own, regions), lambda: load_layers(own, where=path, regions=regions))
    life = read("life", (settings.life, files), lambda: IdleSettings.named(settings.life, parameters))
    faults.found.extend(_layer_faults(settings.links, layers or ()) + _gain_faults(settings.links, regions))
    scripts = [("show", settings.show)] + [
        (f"links[{i}].script", link.simulated) for i, link in enumerate(settings.links)
    ]
    for key, script in scripts:
        if script is not None:
            cache_key = ("script", script, files, more)
            read(key, cache_key, lambda name=script: load_script(name, parameters, vocabulary, beside=path))
    controls = tuple(
        read(f"face.controls[{i}]", (file, files, more), lambda f=file: load_controls(f, parameters, vocabulary))
        for i, file in enumerate(_files(faults, "controls", settings.face.controls, path) if vocabulary else ())
    )
    amounts = tuple(zip(groups, settings.point_groups.values(), strict=False))
    shown = tuple(persons or ())
    stage = Stage(
        path, settings, parameters, head, tuple(robots), more, vocabulary, layers, life, amounts, shown, controls,
        own_groups=parameters.point_groups,
    )  # fmt: skip
    if settings.take is not None:
        take = stage.file(str(settings.take))
        read("take", (take, files), lambda: load_take(take, parameters))
    return stage


def _files(faults: _Faults, kind: str, names: list[str], path: Path) -> tuple[Path, ...]:
    """Return the existing files among those of one kind that a stage names."""
    found = [
        faults.read(f"{kind}[{i}]", (kind, name), lambda name=name: find_config(kind, name, beside=path))
        for i, name in enumerate(names)
    ]
    return tuple(file for file in found if file is not None)


_Known = dict[str, tuple[Any, str]]
"""Cache of what was read, by its cache key: the value, and its fault or an empty text."""


@dataclass(frozen=True)
class _Faults:
    """Reads what a stage names, and collects the faults; what several heads name is read once.

    found : the faults. known : cache, shared by the heads.
    """

    found: list[str]
    known: _Known

    def read(self, key: str, dependencies: tuple[Any, ...], read: Callable[..., object]) -> Any:
        """Return ``read()``, from the cache if possible; a configuration error becomes a fault of ``key``, and None.

        dependencies : everything that the result depends on, as cache key.
        """
        name = repr((key.partition("[")[0], *dependencies))
        if name not in self.known:
            self.known[name] = self._run(read)
        value, fault = self.known[name]
        if fault:
            self.found.append(f"{key}: {fault}")
        return value

    def _run(self, read: Callable[..., object]) -> tuple[Any, str]:
        try:
            return read(), ""
        except (ConfigError, TakeError) as error:
            hint = f" ({error.hint})" if error.hint and "\n" not in str(error) else ""
            return None, f"{error}{hint}".replace("\n", "\n  ")
