"""The buses of a robot file: which family is on each wire, and what that family can be told."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from controller.base.config import Settings
from drivers.base.errors import DriverError

Seconds = Annotated[float, Field(ge=0, le=600, allow_inf_nan=False)]
Text = Annotated[str, Field(max_length=200)]

Family = Literal["dynamixel", "feetech", "maestro", "ssc32", "text", "omote"]
SERVOS, PULSES = ("dynamixel", "feetech"), ("maestro", "ssc32", "text")
BOARDS = (*PULSES, "omote")
SERVO_BAUD, BOARD_BAUD = 1_000_000, 115_200
WATCHDOG_MS = 200

OPTIONS: dict[str, tuple[str, ...]] = {
    "watchdog_ms": SERVOS,
    "takeover": SERVOS,
    "reboot_faulted": SERVOS,
    "min_voltage_v": SERVOS,
    "voltage_wait_s": SERVOS,
    "feedback": SERVOS,
    "slow_group": SERVOS,
    "margin_s": (*SERVOS, *BOARDS),
    "fast": ("dynamixel",),
    "torque_limit": ("feetech",),
    "board": ("maestro",),
    "device": ("maestro",),
    "crc": ("maestro",),
    "template": ("text",),
    "begin": ("text",),
    "separator": ("text",),
    "end": ("text",),
    "off": ("text",),
    "query": ("text",),
    "answer": ("text",),
    "stagger_s": PULSES,
    "checksum": ("omote",),
    "heartbeat_s": ("omote",),
}
"""Which families take an option."""
TEXTS = ("template", "begin", "separator", "end", "off", "query", "answer")
SIMULATION = ("simulates", "transport", "faults", "wire", "latency_s", "seed")
"""Options of a simulated bus, of whatever family."""


class BusSettings(Settings):
    """One wire with many servos. Options that are None were not given; the driver's own default holds."""

    name: str
    kind: Literal[Family, "simulated"]
    port: str = ""
    baud: Annotated[int, Field(ge=300, le=12_000_000)] = SERVO_BAUD
    rate_hz: Annotated[float, Field(ge=1, le=500)] = 50.0

    watchdog_ms: Annotated[int, Field(ge=0, le=2540)] | None = None
    takeover: Literal["adopt", "release", "refuse"] | None = None
    reboot_faulted: bool | None = None
    min_voltage_v: Annotated[float, Field(gt=0, le=60)] | None = None
    voltage_wait_s: Seconds | None = None
    feedback: Literal["full", "position"] | None = None
    slow_group: Annotated[int, Field(ge=0, le=252)] | None = None
    margin_s: Seconds | None = None
    fast: bool | None = None
    torque_limit: Annotated[float, Field(gt=0, le=1)] | None = None

    board: Literal["mini", "micro"] | None = None
    device: Annotated[int, Field(ge=0, le=127)] | None = None
    crc: bool | None = None
    template: Text | None = None
    begin: Text | None = None
    separator: Text | None = None
    end: Text | None = None
    off: Text | None = None
    query: Text | None = None
    answer: Text | None = None
    stagger_s: Annotated[float, Field(ge=0, le=1)] | None = None
    checksum: bool | None = None
    heartbeat_s: Annotated[float, Field(gt=0, le=10)] | None = None

    simulates: Family = "dynamixel"
    transport: Literal["pty", "tcp", "memory"] | None = None
    faults: list[str] = []
    wire: bool = False
    latency_s: Annotated[float, Field(ge=0, le=1)] = 0.0
    seed: int = 0

    @model_validator(mode="before")
    @classmethod
    def _usual_rate(cls, table: Any) -> Any:
        """Boards leave the factory with another rate than servos."""
        if not isinstance(table, dict) or "baud" in table:
            return table
        family = table.get("simulates", "dynamixel") if table.get("kind") == "simulated" else table.get("kind")
        return {**table, "baud": BOARD_BAUD if family in BOARDS else SERVO_BAUD}

    @property
    def family(self) -> str:
        """What is on the wire, simulated or not."""
        return self.simulates if self.kind == "simulated" else self.kind

    def options(self) -> dict[str, Any]:
        """What the driver is told; see :func:`drivers.open_bus`."""
        keys = (*OPTIONS, *SIMULATION, "port")
        given = {key: getattr(self, key) for key in keys if key in self.model_fields_set}
        return {"baud": self.baud, **given}

    @model_validator(mode="after")
    def _fits(self) -> BusSettings:
        self._check_port()
        for key in sorted(self.model_fields_set):
            if key in OPTIONS and self.family not in OPTIONS[key]:
                raise ValueError(f"{key} is not for {self.family}, but for {', '.join(OPTIONS[key])}")
            if key in SIMULATION and self.kind != "simulated":
                raise ValueError(f'{key} is for a simulated bus: set kind = "simulated", or leave it out')
        if self.family == "text":
            self._check_texts()
        watchdog_ms = WATCHDOG_MS if self.watchdog_ms is None else self.watchdog_ms
        if self.family in SERVOS and 0 < watchdog_ms < 2000 / self.rate_hz:
            raise ValueError(f"watchdog_ms must be 0 or span two cycles, {2000 / self.rate_hz:g} at this rate_hz")
        return self

    def _check_port(self) -> None:
        if self.kind != "simulated" and not self.port:
            raise ValueError("port is needed for a real bus; omote ports lists them")
        if self.kind == "simulated" and self.port:
            raise ValueError("port is for a real bus: set kind to its family, or leave the port out")

    def _check_texts(self) -> None:
        from drivers.text.bus import check_texts

        if self.template is None:
            raise ValueError(r'template is missing: how a move is written, for example "#{ch}P{us}\r"')
        try:
            check_texts(**{key: getattr(self, key) or "" for key in TEXTS})
        except DriverError as error:
            raise ValueError(f"{error} ({error.hint})") from error
