"""The report of a preflight, as file and table: measurements of each bus and servo beside the robot file's values."""

from __future__ import annotations

import hashlib
import json
import math
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import tomli_w
from rich.table import Table

from controller.base.errors import ControllerError
from controller.base.files import replacing
from controller.base.version import package_version
from surface.base.files import read_file

FORMAT = 1
"""Version of the report's keys: raised when one changes its meaning or is removed."""
PACKAGES = ("dynamixel-sdk", "pyserial", "numpy")
SUFFIXES = (".toml", ".json")


@dataclass
class BusFindings:
    """Findings of one bus. answer_ms : delay of replies beyond their time on the wire; NaN if unknown."""

    name: str
    family: str
    port: str
    baud: int
    answer_ms: float = math.nan
    faults: list[str] = field(default_factory=list)


@dataclass
class ChannelFindings:
    """Findings of one servo; NaN, an empty text or None where nothing was measured.

    position_deg : position before it moved. limit_deg : limits in the robot's file. own_limit_deg : limits in its own
    registers.
    wanted_deg, moved_deg : range of the goals and of the shaft. lag_ms : delay of the shaft behind the goals.
    peak_current_a, peak_load : greatest current, and fraction of the stall torque, while it moved.
    least_voltage_v : lowest supply voltage while it moved.
    seen : a person's judgement of the direction: ``"right"``, ``"wrong"`` or ``"not asked"``.
    skipped : why it was not moved; empty if it was.
    """

    name: str
    bus: str
    id: int
    model: str
    found_model: str = ""
    firmware: int | None = None
    voltage_v: float = math.nan
    temperature_c: float = math.nan
    position_deg: float = math.nan
    limit_deg: tuple[float, float] = (math.nan, math.nan)
    own_limit_deg: tuple[float, float] = (math.nan, math.nan)
    homing_offset_ticks: int | None = None
    wanted_deg: float = math.nan
    moved_deg: float = math.nan
    lag_ms: float = math.nan
    peak_current_a: float = math.nan
    peak_load: float = math.nan
    least_voltage_v: float = math.nan
    seen: str = "not asked"
    skipped: str = ""
    faults: list[str] = field(default_factory=list)


@dataclass
class Preflight:
    """All findings of one robot. signed_by : name of the person who signed them; empty if nobody did."""

    robot: str
    path: Path
    files: tuple[Path, ...]
    buses: list[BusFindings] = field(default_factory=list)
    channels: list[ChannelFindings] = field(default_factory=list)
    signed_by: str = ""
    date: datetime = field(default_factory=lambda: datetime.now(UTC).replace(microsecond=0))

    @property
    def faults(self) -> list[str]:
        """Every fault, as text with the bus or channel that has it."""
        rows: Sequence[BusFindings | ChannelFindings] = (*self.buses, *self.channels)
        return [f"{row.name}: {fault}" for row in rows for fault in row.faults]

    @property
    def passed(self) -> bool:
        """Whether there is no fault and no servo was skipped."""
        return not self.faults and not any(row.skipped for row in self.channels)

    def as_dict(self) -> dict[str, Any]:
        """Plain values for TOML and JSON, without unknown ones."""
        return {
            "format": FORMAT,
            "kind": "preflight",
            "robot": self.robot,
            "passed": self.passed,
            "signed_by": self.signed_by,
            "date": self.date.isoformat(),
            "versions": _versions(),
            "sha256": {file.name: hashlib.sha256(read_file(file)).hexdigest() for file in self.files},
            "faults": self.faults,
            "buses": [_known(asdict(row)) for row in self.buses],
            "channels": [_known(asdict(row)) for row in self.channels],
        }


def _versions() -> dict[str, str]:
    found = {"omote": package_version(), "python": platform.python_version(), "system": platform.platform(terse=True)}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def _known(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the known values, floats rounded to three decimals."""
    plain: dict[str, Any] = {}
    for key, value in row.items():
        values = value if isinstance(value, tuple) else (value,)
        if any(isinstance(each, float) and not math.isfinite(each) for each in values) or value in ("", None):
            continue
        rounded = [round(each, 3) if isinstance(each, float) else each for each in values]
        plain[key] = rounded if isinstance(value, tuple) else rounded[0]
    return plain


def check_report_path(path: Path) -> None:
    """Raise ControllerError unless the file name has a suffix of a report."""
    if path.suffix not in SUFFIXES:
        raise ControllerError(f"{path}: a report is a .toml or a .json file", hint=f"-o {path.stem}.toml")


def write_preflight(preflight: Preflight, path: Path) -> None:
    """Write the report as TOML or JSON, whole or not at all; raises ControllerError where it cannot be written."""
    table = preflight.as_dict()
    text = json.dumps(table, indent=2) + "\n" if path.suffix == ".json" else tomli_w.dumps(table)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def preflight_table(preflight: Preflight) -> Table:
    """Table with one row per servo."""
    table = Table("channel", "id", "model", "supply", "stands at", "moved", "of", "lag", "load", "direction", "")
    for row in preflight.channels:
        load = _with(row.peak_current_a, "{:.2f} A") or _with(100 * row.peak_load, "{:.0f} %")
        table.add_row(
            row.name,
            str(row.id),
            row.found_model or row.model,
            _with(row.voltage_v, "{:.1f} V"),
            _with(row.position_deg, "{:.1f}"),
            _with(row.moved_deg, "{:.1f}"),
            _with(row.wanted_deg, "{:.1f}"),
            _with(row.lag_ms, "{:.0f} ms"),
            load,
            row.seen,
            "; ".join(row.faults) or row.skipped or "good",
        )
    return table


def _with(value: float, form: str) -> str:
    return "" if math.isnan(value) else form.format(value)
