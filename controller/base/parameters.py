"""The parameters: names, order, ranges, regions and motion limits, read from the base vocabulary.

Every parameter vector in omote is (P,) float64 in the order of ``configs/vocabularies/arkit.toml``.
"""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.base.errors import ConfigError, ParameterError
from controller.base.paths import config_dir

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]

REGIONS = ("brows", "lids", "eyes", "cheeks", "nose", "jaw", "mouth", "tongue", "head")
"""Regions of the face, in the order reports list them."""

_KEYS = {
    "range", "region", "profile", "max_speed", "max_acceleration", "max_jerk", "response_s",
    "full_scale_deg", "max_speed_deg_s", "max_acceleration_deg_s2", "max_jerk_deg_s3",
}  # fmt: skip
_ARRAYS = ("low", "high", "full_scale_rad", "max_speed", "max_acceleration", "max_jerk", "response_s")


@dataclass(frozen=True, eq=False)
class Parameters:
    """The registry of parameters; all arrays are (P,) float64 and read-only.

    Attributes
    ----------
    names : canonical names, in canonical order.
    regions : region of each parameter, one of :data:`REGIONS`.
    low, high : range of each parameter.
    full_scale_rad : angle (rad) the value 1 stands for; NaN where the parameter is not an angle.
    max_speed : largest speed (units/s). max_acceleration : largest acceleration (units/s^2).
    max_jerk : largest jerk (units/s^3); infinity for none. response_s : time constant (s) of the approach to a target.
    aliases : other spellings, folded, to canonical names.
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

    @classmethod
    def load(cls, path: Path | None = None) -> Parameters:
        """Read a base vocabulary; the shipped one without ``path``.

        Raises
        ------
        ConfigError : the file cannot be read or is wrong; every fault with its key.
        """
        path = path or config_dir() / "vocabularies" / "arkit.toml"
        return _build(path, read_toml(path))

    def __len__(self) -> int:
        return len(self.names)

    def index(self, name: str) -> int:
        """Position of ``name``, any known spelling.

        Raises
        ------
        ParameterError : no such parameter; the message says the nearest names.
        """
        found = self._lookup.get(name)  # the canonical spelling needs no folding
        if found is None:
            found = self._lookup.get(fold(name))
        if found is None:
            raise ParameterError(
                f"unknown parameter {name!r}{did_you_mean(name, self.names)}",
                hint="list the names: LIST PARAMETERS on the link, or configs/vocabularies/arkit.toml",
            )
        return found

    def indices(self, names: Iterable[str]) -> NDArray[np.intp]:
        """Positions of ``names``. Raises ParameterError at the first unknown one."""
        return np.array([self.index(name) for name in names], dtype=np.intp)

    def region(self, name: str) -> NDArray[np.intp]:
        """Positions of every parameter of a region. Raises ParameterError for an unknown region."""
        if name not in REGIONS:
            raise ParameterError(f"unknown region {name!r}{did_you_mean(name, REGIONS)}", hint=", ".join(REGIONS))
        return np.array([i for i, region in enumerate(self.regions) if region == name], dtype=np.intp)

    def clip(self, values: Floats, out: Floats) -> Floats:
        """Write ``values`` : (P,), kept in range, to ``out``; what is not finite leaves ``out`` as it was."""
        np.copyto(out, values, where=np.isfinite(values))
        return np.clip(out, self.low, self.high, out=out)

    def neutral(self) -> Floats:
        """A new (P,) vector of the neutral face: all zero."""
        return np.zeros(len(self.names))

    def mirror(self) -> NDArray[np.intp]:
        """(P,) position of each parameter's counterpart on the other side; itself where there is none."""
        return np.array([self._lookup.get(_other_side(name), i) for i, name in enumerate(self.names)])

    @cached_property
    def _lookup(self) -> dict[str, int]:
        table = {name: i for i, name in enumerate(self.names)}
        table |= {fold(name): i for i, name in enumerate(self.names)}
        return table | {alias: table[name] for alias, name in self.aliases.items()}


def fold(name: str) -> str:
    """One spelling for all: lower case, ``_L``/``_R`` (``-``, ``.``) as left/right at the end."""
    plain = re.sub(r"[\s_.\-]+", "_", name.strip()).lower()
    plain = re.sub(r"_l$", "left", plain)
    plain = re.sub(r"_r$", "right", plain)
    return plain.replace("_", "")


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """``, did you mean 'x'?`` or nothing; at most three guesses."""
    folded = {fold(k): k for k in known}
    close = difflib.get_close_matches(fold(name), folded, n=3, cutoff=0.6)
    if not close:
        return ""
    return ", did you mean " + " or ".join(repr(folded[c]) for c in close) + "?"


def read_toml(path: Path) -> dict[str, Any]:
    """A TOML file as tables. Raises ConfigError when it cannot be read."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}", hint=f"look at: ls -l {path}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not valid TOML: {error}", hint="mend the line named above") from error


def file_error(path: Path, faults: list[str]) -> ConfigError:
    """One error for all faults of a file. Imports the models of configuration only when there is one to report."""
    from controller.base.config import config_error  # start-up: pydantic, only for a fault

    return config_error(path, faults)


@cache
def standard() -> Parameters:
    """The shipped parameters, read once."""
    return Parameters.load()


PARAMETERS: Parameters
"""The shipped parameters; read when first asked for."""


def __getattr__(name: str) -> Any:
    if name == "PARAMETERS":
        return standard()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def _other_side(name: str) -> str:
    swap = {"Left": "Right", "Right": "Left", "left": "right", "right": "left"}
    return re.sub("Left$|Right$|^left|^right", lambda m: swap[m.group()], name)


def _build(path: Path, table: dict[str, Any]) -> Parameters:
    faults = [f"{key}: unknown key" for key in sorted(set(table) - {"profile", "parameters", "aliases"})]
    entries = {
        name: _entry(name, given, table.get("profile", {}), faults)
        for name, given in table.get("parameters", {}).items()
    }
    if not entries and not faults:
        faults.append("parameters: missing")
    aliases = table.get("aliases", {})
    faults += [f"aliases.{a}: unknown parameter {n!r}{did_you_mean(str(n), entries)}"
               for a, n in aliases.items() if n not in entries]  # fmt: skip
    if faults:
        raise file_error(path, faults)
    arrays = {key: np.array([entry[key] for entry in entries.values()], dtype=np.float64) for key in _ARRAYS}
    for array in arrays.values():
        array.flags.writeable = False
    regions = tuple(entry["region"] for entry in entries.values())
    return Parameters(tuple(entries), regions, **arrays, aliases={fold(a): n for a, n in aliases.items()})


def _entry(name: str, given: Any, profiles: dict[str, Any], faults: list[str]) -> dict[str, Any]:
    where = f"parameters.{name}"
    if not isinstance(given, dict):
        faults.append(f'{where}: must be a table like {{ region = "mouth", profile = "mouth" }}')
        return {}
    profile = given.get("profile")
    if profile is not None and profile not in profiles:
        faults.append(f"{where}.profile: unknown profile {profile!r}{did_you_mean(str(profile), profiles)}")
        return {}
    merged = {**profiles.get(str(profile), {}), **given}
    faults += [f"{where}.{key}: unknown key" for key in sorted(set(merged) - _KEYS)]
    return _numbers(where, merged, faults)


def _numbers(where: str, merged: dict[str, Any], faults: list[str]) -> dict[str, Any]:
    """The entry in normalised units: degrees divided by the full scale."""
    if merged.get("region") not in REGIONS:
        faults.append(f"{where}.region: must be one of {', '.join(REGIONS)} (is {merged.get('region')!r})")
    full = _positive(where, "full_scale_deg", merged, faults) if "full_scale_deg" in merged else math.nan
    angular = not math.isnan(full)
    names = ("max_speed_deg_s", "max_acceleration_deg_s2") if angular else ("max_speed", "max_acceleration")
    jerk = "max_jerk_deg_s3" if angular else "max_jerk"
    speed, acceleration = (_positive(where, key, merged, faults) for key in names)
    low, high = _range(where, merged, faults)
    scale = full if angular else 1.0
    return {
        "region": merged.get("region"),
        "low": low,
        "high": high,
        "full_scale_rad": math.radians(full),
        "max_speed": speed / scale,
        "max_acceleration": acceleration / scale,
        "max_jerk": _positive(where, jerk, merged, faults) / scale if jerk in merged else math.inf,
        "response_s": _positive(where, "response_s", merged, faults),
    }


def _positive(where: str, key: str, merged: dict[str, Any], faults: list[str]) -> float:
    value: Any = merged.get(key)
    if not (_finite(value) and value > 0):
        faults.append(f"{where}.{key}: must be a positive number (is {value!r})")
        return 1.0
    return float(value)


def _range(where: str, merged: dict[str, Any], faults: list[str]) -> tuple[float, float]:
    value = merged.get("range")
    if not (isinstance(value, list) and len(value) == 2 and all(map(_finite, value)) and value[0] < value[1]):
        faults.append(f"{where}.range: must be [lowest, highest] (is {value!r})")
        return 0.0, 1.0
    return float(value[0]), float(value[1])


def _finite(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
