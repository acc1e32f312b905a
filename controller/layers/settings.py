"""Reads the settings of layers from their file, with the changes of a stage."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from controller.base.config import Fraction, Number, Settings, check, read_toml
from controller.base.parameters import REGIONS, did_you_mean
from controller.base.paths import config_dir
from controller.layers.mixer import LayerSettings, Mode

NEEDED = ("expression", "idle", "gaze", "speech", "capture", "manual")
"""Layers that every stage must have, because the code writes to them by name."""

_Seconds = Annotated[Number, Field(ge=0, le=3600)]
_Gain = Annotated[Number, Field(ge=0, le=4)]


class LayerTable(Settings):
    priority: int
    mode: Mode = "set"
    weight: Fraction = 1.0
    fade_in_s: _Seconds = 0.0
    fade_out_s: _Seconds = 0.4
    timeout_s: Annotated[float, Field(gt=0)] = math.inf
    gains: dict[str, _Gain] = {}


class LayersTable(Settings):
    layers: dict[str, LayerTable]


def load_layers(
    changes: Mapping[str, Mapping[str, Any]] | None = None, *, where: Path | None = None, base: Path | None = None,
    regions: Sequence[str] = REGIONS,
) -> tuple[LayerSettings, ...]:  # fmt: skip
    """Return the shipped layers, with the ``changes`` of a stage file: other values for some keys, or more layers.

    where : the file of the changes, for messages. base : a file to read instead of the shipped one.
    regions : regions of the face that gains may name.

    Raises ConfigError: an invalid key or value, or two layers with one priority; it lists every fault with its key.
    """
    path = base or config_dir() / "vocabularies" / "layers.toml"
    shipped, changes = read_toml(path), changes or {}
    merged = {name: _merge(shipped.get(name, {}), changes.get(name, {})) for name in {**shipped, **changes}}
    tables = check({"layers": merged}, LayersTable, where or path, partial(_faults, regions)).layers
    return tuple(LayerSettings(name, **dict(table)) for name, table in tables.items())


def _merge(shipped: Any, changes: Mapping[str, Any]) -> Any:
    """Return a layer's table with changes; anything but a table is returned unchanged, for the check to report."""
    return {**shipped, **changes} if isinstance(shipped, Mapping) else shipped


@cache
def default_layers() -> tuple[LayerSettings, ...]:
    """Return the shipped layers, which are read only once. Raises ConfigError."""
    return load_layers()


def _faults(regions: Sequence[str], file: LayersTable) -> list[str]:
    faults = [f"layers.{name}: missing" for name in NEEDED if name not in file.layers]
    faults += [
        f"layers.{name}.gains.{region}: no region called {region!r}{did_you_mean(region, regions)}"
        for name, table in file.layers.items()
        for region in table.gains
        if region not in regions
    ]
    first: dict[int, str] = {}
    for name, table in file.layers.items():
        other = first.setdefault(table.priority, name)
        if other != name:
            faults.append(f"layers.{name}.priority: {table.priority} is that of {other}; every layer needs its own")
    return faults
