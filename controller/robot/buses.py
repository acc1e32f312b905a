"""The buses of a robot file: which family is on each wire, and what that family can be told."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any, Literal

from pydantic import (
    Field,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)

from controller.base.config import Settings
from controller.base.schema import check_kind, fields_of, parse_with, to_options
from drivers.base.errors import PluginError
from drivers.core.families import SERVO_BAUD, Family
from drivers.core.registry import FAMILIES, SIMULATED, no_simulator_error

SIMULATION = ("simulates", "transport", "faults", "wire", "latency_s", "seed")
"""Options of a simulated bus, of whatever family."""


Baud = Annotated[int, Field(ge=300, le=12_000_000)]


class BusSettings(Settings):
    """One wire with many servos; the fields of its family's own options come besides (:func:`read_bus`).

    Options that are None were not given; the driver's own default holds.
    """

    name: str
    kind: str
    port: str = ""
    baud: Baud = SERVO_BAUD
    rate_hz: Annotated[float, Field(ge=1, le=500)] = 50.0

    simulates: str = "dynamixel"
    transport: Literal["pty", "tcp", "memory"] | None = None
    faults: list[str] = []
    wire: bool = False
    latency_s: Annotated[float, Field(ge=0, le=1)] = 0.0
    seed: int = 0

    @classmethod
    def known_keys(cls) -> list[str]:
        """Keys of such a table, those of all families included."""
        return [*super().known_keys(), *takers()]

    @property
    def family(self) -> str:
        """What is on the wire, simulated or not."""
        return family_in({"kind": self.kind, "simulates": self.simulates})

    def options(self) -> dict[str, Any]:
        """What the driver is told; see :func:`drivers.open_bus`."""
        own = [key for key in type(self).model_fields if key not in BusSettings.model_fields]
        given = {key: getattr(self, key) for key in (*SIMULATION, "port") if key in self.model_fields_set}
        told = {key: value for key in own if (value := getattr(self, key)) is not None}
        return {"baud": self.baud, **given, **told}

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
        self._check_port()
        for key in sorted(self.model_fields_set & set(SIMULATION)):
            if self.kind != SIMULATED:
                raise ValueError(f'{key} is for a simulated bus: set kind = "simulated", or leave it out')
        settings = FAMILIES.get(self.family).settings
        check = getattr(settings, "check", None)
        if check is not None:
            with FAMILIES.blaming(self.family):
                check(to_options(self, settings), self.rate_hz)
        return self

    def _check_port(self) -> None:
        if self.kind != SIMULATED and not self.port:
            raise ValueError("port is needed for a real bus; omote ports lists them")
        if self.kind == SIMULATED and self.port:
            raise ValueError("port is for a real bus: set kind to its family, or leave the port out")


def family_in(table: dict[str, Any]) -> str:
    """The family that a bus's table names, simulated or not."""
    kind = table.get("kind")
    return str(table.get("simulates", "dynamixel") if kind == SIMULATED else kind)


def read_bus(table: dict[str, Any]) -> BusSettings:
    """A bus from its table in a robot file, with the options of its family.

    Raises
    ------
    pydantic.ValidationError : every fault with its key.
    """
    try:
        family = FAMILIES.get(family_in(table))
    except PluginError:
        return _Unknown.model_validate(table)  # which says what is wrong with the kind
    return _model_of(family).model_validate(table)


def takers() -> dict[str, list[str]]:
    """The families that take each option."""
    found: dict[str, list[str]] = {}
    for family in FAMILIES.all():
        for key in fields_of(family.settings):
            found.setdefault(key, []).append(family.kind)
    return found


class _Unknown(BusSettings, extra="ignore"):
    """A bus of an unknown kind: nothing is known of its other keys."""


@cache
def _model_of(family: Family) -> type[BusSettings]:
    """The table of a family's bus, with its own options and its usual rate."""
    own = fields_of(family.settings)

    def refuse_others(table: dict[str, Any]) -> dict[str, Any]:
        for key in sorted(set(table) - {*BusSettings.model_fields, *own}):
            if key in (others := takers()):
                raise ValueError(f"{key} is not for {family.kind}, but for {', '.join(others[key])}")
        return table

    validators = {"refuse_others": model_validator(mode="before")(refuse_others)}
    own["baud"] = (Baud, family.baud)
    make: Any = create_model
    made: type[BusSettings] = make(f"{family.kind} bus", __base__=BusSettings, __validators__=validators, **own)
    return made


Bus = Annotated[BusSettings, parse_with(read_bus)]
"""An entry of ``[[buses]]``: read by its family's own options."""
