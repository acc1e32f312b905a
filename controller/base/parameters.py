"""The registry of face parameters: names, order, ranges, regions and motion limits, read from the base vocabulary.

Every parameter vector in omote is (P,) float64 in the order of ``configs/vocabularies/arkit.toml``. Custom parameters,
which vocabularies of a stage or robot add, follow in the order of their files.
"""

from __future__ import annotations

import difflib
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, field_validator

from controller.base.config import Number, Positive, Settings, check, load, may_guess, read_toml
from controller.base.errors import ParameterError
from controller.base.paths import config_dir

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]

REGIONS = ("brows", "lids", "eyes", "cheeks", "nose", "jaw", "mouth", "tongue", "head")
"""Regions of the face, in the order of reports."""
TABLE_KEYS = ("regions", "profile", "parameters", "aliases")
"""Keys of a vocabulary file that describe parameters; all other keys are names of expressions."""

_ARRAYS = ("low", "high", "full_scale_rad", "max_speed", "max_acceleration", "max_jerk", "response_s", "rest")
_MAX_PER_FILE = 512
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
_RESERVED = frozenset({"all", "time", "type", "face", "subject", "measured", "neutral"})  # words of formats and links


@dataclass(frozen=True)
class PointGroup:
    """Control points that a parameter moves.

    file : of the group. times : names of parameters whose values multiply the amount.
    """

    file: Path
    times: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Parameters:
    """The registry of parameters; all arrays are (P,) float64 and read-only.

    names : canonical names, in the order of the vectors.
    regions : region of each parameter, one of :data:`REGIONS`.
    low, high : range of each parameter.
    full_scale_rad : angle (rad) of the value 1; NaN where the parameter is not an angle.
    max_speed : largest speed (units/s). max_acceleration : largest acceleration (units/s^2).
    max_jerk : largest jerk (units/s^3); infinity for none. response_s : time constant (s) of the approach to a target.
    rest : value in the neutral face. Default: 0, as for all of the base vocabulary.
    aliases : canonical names by other spelling, folded.
    base : number of parameters of the base vocabulary, which come first; custom ones follow.
    descriptions : texts for people about some parameters, by name. own_regions : regions that custom vocabularies add.
    files : the vocabularies that were added. point_groups : control points that custom parameters move, by name.
    """

    names: tuple[str, ...]
    regions: tuple[str, ...]
    low: Floats
    high: Floats
    full_scale_rad: Floats
    max_speed: Floats
    max_acceleration: Floats
    max_jerk: Floats
    response_s: Floats
    aliases: dict[str, str] = field(default_factory=dict)
    rest: Floats = field(default_factory=lambda: np.zeros(0))
    base: int = -1
    descriptions: dict[str, str] = field(default_factory=dict)
    own_regions: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()
    point_groups: Mapping[str, PointGroup] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not len(self.rest):
            object.__setattr__(self, "rest", np.zeros(len(self.names)))
        if self.base < 0:
            object.__setattr__(self, "base", len(self.names))

    @classmethod
    def load(cls, path: Path | None = None) -> Parameters:
        """Read a base vocabulary; by default, the shipped one. Raises ConfigError that lists every fault."""
        path = path or config_dir() / "vocabularies" / "arkit.toml"
        return _build(load(path, _File, lambda file: [*_unknown_regions(file), *_unknown_aliases(file)]))

    def with_files(self, paths: Iterable[Path]) -> Parameters:
        """Return these parameters, followed by the custom ones of vocabulary files.

        ``paths`` : a file that was added before, or that describes no parameters, adds nothing.

        Raises ConfigError: a file cannot be read or is wrong; lists every fault with its key.
        """
        found = self
        for path in map(Path.resolve, paths):
            if path not in found.files:
                found = found._with_file(path)
        return found

    def _with_file(self, path: Path) -> Parameters:
        table = read_toml(path)
        if not describes_parameters(table):
            return self
        own = {key: table[key] for key in TABLE_KEYS if key in table}
        if isinstance(own.get("profile", {}), Mapping):
            own["profile"] = {**_shipped_profiles(), **own.get("profile", {})}
        file = check(own, _File, path, partial(_custom_faults, self, path.parent))
        more = _build(file)
        arrays: dict[str, Any] = {name: np.concatenate([getattr(self, name), getattr(more, name)]) for name in _ARRAYS}
        for array in arrays.values():
            array.flags.writeable = False
        return replace(
            self,
            names=self.names + more.names,
            regions=self.regions + more.regions,
            aliases=self.aliases | more.aliases,
            descriptions=self.descriptions | more.descriptions,
            own_regions=(*self.own_regions, *(r for r in more.own_regions if r not in self.region_names)),
            files=(*self.files, path),
            point_groups={**self.point_groups, **_point_groups(file, path.parent)},
            **arrays,
        )

    @property
    def own(self) -> tuple[str, ...]:
        """Names of the custom parameters, which vocabularies of a stage or robot add."""
        return self.names[self.base :]

    @property
    def region_names(self) -> tuple[str, ...]:
        """Regions of the face, followed by those that custom vocabularies add."""
        return REGIONS + self.own_regions

    def __len__(self) -> int:
        return len(self.names)

    def find(self, name: str) -> int | None:
        """Return the index of ``name`` in any known spelling; None if there is no such parameter."""
        found = self._lookup.get(name)  # the canonical spelling needs no folding
        return self._lookup.get(fold(name)) if found is None else found

    def index(self, name: str) -> int:
        """Return the index of ``name`` in any known spelling.

        Raises ParameterError: no such parameter; the message suggests similar names.
        """
        found = self.find(name)
        if found is None:
            raise ParameterError(
                f"unknown parameter {name!r}{did_you_mean(name, self.names)}",
                hint="list the names: LIST PARAMETERS on the link, or configs/vocabularies/arkit.toml",
            )
        return found

    def indices(self, names: Iterable[str]) -> NDArray[np.intp]:
        """Return the indices of ``names``. Raises ParameterError at the first unknown one."""
        return np.array([self.index(name) for name in names], dtype=np.intp)

    def region(self, name: str) -> NDArray[np.intp]:
        """Return the indices of all parameters of a region. Raises ParameterError: an unknown region."""
        if name not in (known := self.region_names):
            raise ParameterError(f"unknown region {name!r}{did_you_mean(name, known)}", hint=", ".join(known))
        return np.array([i for i, region in enumerate(self.regions) if region == name], dtype=np.intp)

    def clip(self, values: Floats, out: Floats) -> Floats:
        """Write ``values`` : (P,) to ``out``, clipped to their ranges, and return it; skip nonfinite ones."""
        np.copyto(out, values, where=np.isfinite(values))
        return np.clip(out, self.low, self.high, out=out)

    def neutral(self) -> Floats:
        """Return a new (P,) vector of the neutral face: zero, except for custom parameters with another rest value."""
        return self.rest.copy()

    def mirror(self) -> NDArray[np.intp]:
        """Return (P,) the index of each parameter's counterpart on the other side, or its own if there is none."""
        return np.array([self._lookup.get(_other_side(name), i) for i, name in enumerate(self.names)])

    @cached_property
    def _lookup(self) -> dict[str, int]:
        table = {name: i for i, name in enumerate(self.names)}
        table |= {fold(name): i for i, name in enumerate(self.names)}
        return table | {alias: table[name] for alias, name in self.aliases.items()}


def fold(name: str) -> str:
    """Normalise the spelling of a name: lower case, no separators, a final ``_L`` or ``_R`` as left or right."""
    plain = re.sub(r"[\s_.\-]+", "_", name.strip()).lower()
    plain = re.sub(r"_l$", "left", plain)
    plain = re.sub(r"_r$", "right", plain)
    return plain.replace("_", "")


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return ``, did you mean 'x'?`` with at most three suggestions, or an empty text."""
    if not may_guess():
        return ""
    folded = {fold(k): k for k in known}
    close = difflib.get_close_matches(fold(name), folded, n=3, cutoff=0.6)
    if not close:
        return ""
    return ", did you mean " + " or ".join(repr(folded[c]) for c in close) + "?"


PARAMETERS: Parameters
"""The shipped parameters, which are read at the first use of this name."""


@cache
def __getattr__(name: str) -> Any:
    if name == "PARAMETERS":
        return Parameters.load()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def _other_side(name: str) -> str:
    swap = {"Left": "Right", "Right": "Left", "left": "right", "right": "left"}
    return re.sub("Left$|Right$|^left|^right", lambda m: swap[m.group()], name)


def _require_ascending(value: tuple[float, float]) -> tuple[float, float]:
    if value[0] >= value[1]:
        raise ValueError(f"must be [lowest, highest], not {list(value)}")
    return value


class _Entry(Settings, validate_default=True):
    """One parameter of a file, with the keys of its profile; motion limits of an angle are in degrees."""

    region: str
    profile: str | None = None
    range: Annotated[tuple[Number, Number], AfterValidator(_require_ascending)]
    response_s: Positive
    full_scale_deg: Positive | None = None
    max_speed: Positive | None = None
    max_acceleration: Positive | None = None
    max_jerk: Positive | None = None
    max_speed_deg_s: Positive | None = None
    max_acceleration_deg_s2: Positive | None = None
    max_jerk_deg_s3: Positive | None = None
    rest: Number = 0.0
    description: Annotated[str, Field(max_length=400)] = ""
    group: str = ""
    times: Annotated[list[str], Field(max_length=4)] = []

    @field_validator("rest")
    @classmethod
    def _inside(cls, value: float, info: ValidationInfo) -> float:
        low, high = info.data.get("range", (value, value))
        if not low <= value <= high:
            raise ValueError(f"must lie in the range, {low:g} to {high:g}")
        return value

    @field_validator("max_speed", "max_acceleration", "max_speed_deg_s", "max_acceleration_deg_s2")
    @classmethod
    def _given(cls, value: float | None, info: ValidationInfo) -> float | None:
        in_degrees = info.data.get("full_scale_deg") is not None
        if value is None and in_degrees == ("deg" in str(info.field_name)):
            raise ValueError("missing, must be a positive number")
        return value

    def numbers(self) -> tuple[float, ...]:
        """Return the values for :data:`_ARRAYS`, with limits in degrees divided by the full scale."""
        if self.full_scale_deg is None:
            scale, full, limits = 1.0, math.nan, (self.max_speed, self.max_acceleration, self.max_jerk)
        else:
            scale = full = self.full_scale_deg
            limits = self.max_speed_deg_s, self.max_acceleration_deg_s2, self.max_jerk_deg_s3
        scaled = (math.inf if limit is None else limit / scale for limit in limits)
        return (*self.range, math.radians(full), *scaled, self.response_s, self.rest)


def _with_profile(given: Any, info: ValidationInfo) -> Any:
    """Merge the table of a parameter into the table of its profile."""
    if not isinstance(given, dict) or "profile" not in given:
        return given
    profiles, name = info.data.get("profile", {}), str(given["profile"])
    if name not in profiles:
        raise ValueError(f"unknown profile {name!r}{did_you_mean(name, profiles)}")
    return profiles[name] | given


class _File(Settings):
    regions: Annotated[list[str], Field(max_length=32)] = []
    profile: dict[str, dict[str, Any]] = {}
    parameters: Annotated[
        dict[str, Annotated[_Entry, BeforeValidator(_with_profile)]], Field(min_length=1, max_length=_MAX_PER_FILE)
    ]
    aliases: dict[str, str] = {}


def _unknown_aliases(file: _File) -> list[str]:
    return [
        f"aliases.{alias}: unknown parameter {name!r}{did_you_mean(name, file.parameters)}"
        for alias, name in file.aliases.items()
        if name not in file.parameters
    ]


def _unknown_regions(file: _File, known: Sequence[str] = REGIONS) -> Iterator[str]:
    known = (*known, *file.regions)
    for name, entry in file.parameters.items():
        if (region := entry.region) not in known:
            yield (
                f"parameters.{name}.region: unknown region {region!r}{did_you_mean(region, known)}; "
                f"regions = [{region!r}] at the top of a file of your own adds it"
            )


def describes_parameters(table: Mapping[str, Any]) -> bool:
    """Whether a vocabulary's table adds parameters: its ``parameters`` is not an expression of that name."""
    found = table.get("parameters")
    return isinstance(found, Mapping) and not {"weights", "of"} & set(found)


@cache
def _shipped_profiles() -> dict[str, Any]:
    profiles: dict[str, Any] = read_toml(config_dir() / "vocabularies" / "arkit.toml").get("profile", {})
    return profiles


def _point_groups(file: _File, folder: Path) -> dict[str, PointGroup]:
    entries = {name: entry for name, entry in file.parameters.items() if entry.group}
    return {name: PointGroup(folder / entry.group, tuple(entry.times)) for name, entry in entries.items()}


def _group_faults(known: Parameters, folder: Path, file: _File) -> Iterator[str]:
    """Yield faults of groups of control points: missing files, and unknown parameters as multipliers."""
    names = (*known.names, *file.parameters)
    for name, entry in file.parameters.items():
        if entry.group and not os.path.isfile(folder / entry.group):
            yield f"parameters.{name}.group: no file {entry.group!r} beside this one"
        if entry.times and not entry.group:
            yield f"parameters.{name}.times: needs group, the file of the control points"
        for each in entry.times:
            if each not in names:
                yield f"parameters.{name}.times: unknown parameter {each!r}{did_you_mean(each, names)}"


def _custom_faults(known: Parameters, folder: Path, file: _File) -> list[str]:
    """Return the faults of custom parameters: invalid, reserved or repeated names, unknown regions, missing files."""
    faults = [f"regions: {name!r} must be a letter, then letters, digits or _" for name in file.regions
              if not _NAME.fullmatch(name)]  # fmt: skip
    faults += [*_unknown_aliases(file), *_unknown_regions(file, known.region_names)]
    faults += _group_faults(known, folder, file)
    seen: dict[str, str] = {}
    for where, name in _spellings(file):
        key = fold(name)
        if not _NAME.fullmatch(name):
            faults.append(f"{where}: must be a letter, then letters, digits or _, 64 at most")
        elif key in _RESERVED:
            faults.append(f"{where}: is a word of links and formats; choose another name")
        elif (found := known.find(name)) is not None:
            faults.append(f"{where}: is a name of {known.names[found]} already; choose another one")
        elif seen.setdefault(key, where) != where:
            faults.append(f"{where}: is the same name as {seen[key]}")
    return faults


def _spellings(file: _File) -> Iterator[tuple[str, str]]:
    yield from ((f"parameters.{name}", name) for name in file.parameters)
    yield from ((f"aliases.{name}", name) for name in file.aliases)


def _build(file: _File) -> Parameters:
    columns = np.array([entry.numbers() for entry in file.parameters.values()]).T.copy()
    columns.flags.writeable = False
    regions = tuple(entry.region for entry in file.parameters.values())
    aliases = {fold(alias): name for alias, name in file.aliases.items()}
    return Parameters(
        tuple(file.parameters),
        regions,
        **dict(zip(_ARRAYS, columns, strict=True)),
        aliases=aliases,
        descriptions={name: entry.description for name, entry in file.parameters.items() if entry.description},
        own_regions=tuple(file.regions),
    )
