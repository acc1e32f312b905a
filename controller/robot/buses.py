"""Settings of the buses in a robot file: the family of servos on each wire, and the options of that family."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationInfo, create_model, field_validator, model_validator

from controller.base.config import Settings
from controller.base.schema import check_kind, fields_of, parse_with, to_options
from drivers.base.errors import PluginError
from drivers.core.families import SERVO_BAUD, Family
from drivers.core.registry import FAMILIES, SIMULATED, no_simulator_error

SIMULATION = ("simulates", "transport", "faults", "wire", "latency_s", "seed")
"""Options of a simulated bus of any family."""

Baud = Annotated[int, Field(ge=300, le=12_000_000)]


class BusSettings(Settings):
    """One wire with many servos; :func:`read_bus` adds the fields of its family's options.

    Options that are None were not given; the driver uses its default.
    """

    name: str
    kind: str
    port: str = ""
    baud: Baud = SERVO_BAUD
    rate_hz: Annotated[float, Field(ge=1, le=500)] = 50.0
    let_go_s: Annotated[float, Field(ge=0, le=3600)] = 0.0
    let_go_below_a: Annotated[float, Field(gt=0, le=5)] = 0.05

    simulates: str = "dynamixel"
    transport: Literal["pty", "tcp", "memory"] | None = None
    faults: list[str] = []
    wire: bool = False
    latency_s: Annotated[float, Field(ge=0, le=1)] = 0.0
    seed: int = 0

    @classmethod
    def known_keys(cls) -> list[str]:
        """Keys that a table of a bus may have, including the options of all families."""
        return [*super().known_keys(), *families_by_option()]

    @property
    def family(self) -> str:
        """The family of servos on the wire, simulated or not."""
        return family_in({"kind": self.kind, "simulates": self.simulates})

    def options(self) -> dict[str, Any]:
        """Options for the driver; see :func:`drivers.open_bus`."""
        own = [key for key in type(self).model_fields if key not in BusSettings.model_fields]
        given = {key: getattr(self, key) for key in (*SIMULATION, "port") if key in self.model_fields_set}
        set_ = {key: value for key in own if (value := getattr(self, key)) is not None}
        return {"baud": self.baud, **given, **set_}

    @field_validator("kind", "simulates")
    @classmethod
    def _is_known(cls, value: str, info: ValidationInfo) -> str:
        if info.field_name == "kind" and value == SIMULATED:
            return value
        if info.field_name == "simulates" and value in FAMILIES.kinds() and not FAMILIES.get(value).simulator:
            raise ValueError(f"{no_simulator_error(value)}; use a real one")
        return check_kind(FAMILIES, value)

    @model_validator(mode="after")
    def _fits(self) -> BusSettings:
        if self.kind != SIMULATED and not self.port:
            raise ValueError("port is needed for a real bus; omote ports lists them")
        if self.kind == SIMULATED and self.port:
            raise ValueError("port is for a real bus: set kind to its family, or leave the port out")
        for key in sorted(self.model_fields_set & set(SIMULATION)):
            if self.kind != SIMULATED:
                raise ValueError(f'{key} is for a simulated bus: set kind = "simulated", or leave it out')
        settings = FAMILIES.get(self.family).settings
        check = getattr(settings, "check", None)
        if check is not None:
            with FAMILIES.naming_package(self.family):
                check(to_options(self, settings), self.rate_hz)
        return self


def family_in(table: dict[str, Any]) -> str:
    """The family that a bus's table names, simulated or not."""
    kind = table.get("kind")
    return str(table.get("simulates", "dynamixel") if kind == SIMULATED else kind)


def read_bus(table: dict[str, Any]) -> BusSettings:
    """Read a bus from its table in a robot file, with its family's options; raises pydantic.ValidationError."""
    try:
        family = FAMILIES.get(family_in(table))
    except PluginError:
        return _Unknown.model_validate(table)  # its error names the kind
    return _model_of(family).model_validate(table)


def families_by_option() -> dict[str, list[str]]:
    """Map each option to the families that have it."""
    found: dict[str, list[str]] = {}
    for family in FAMILIES.all():
        for key in fields_of(family.settings):
            found.setdefault(key, []).append(family.kind)
    return found


class _Unknown(BusSettings, extra="ignore"):
    """A bus of an unknown kind, whose other keys cannot be checked."""


@cache
def _model_of(family: Family) -> type[BusSettings]:
    """Create the settings class of a family's bus, with the family's options and default baud rate."""
    own = fields_of(family.settings)

    def refuse_others(table: dict[str, Any]) -> dict[str, Any]:
        for key in sorted(set(table) - {*BusSettings.model_fields, *own}):
            if key in (others := families_by_option()):
                raise ValueError(f"{key} is not for {family.kind}, but for {', '.join(others[key])}")
        return table

    validators = {"refuse_others": model_validator(mode="before")(refuse_others)}
    own["baud"] = (Baud, family.baud)
    make: Any = create_model
    model: type[BusSettings] = make(f"{family.kind} bus", __base__=BusSettings, __validators__=validators, **own)
    return model


Bus = Annotated[BusSettings, parse_with(read_bus)]
"""An entry of ``[[buses]]``, read with the options of its family."""
