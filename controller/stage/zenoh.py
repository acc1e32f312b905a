"""The table ``[zenoh]`` of a stage: which part of it this process runs, and how it meets the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, field_validator, model_validator

from controller.base.config import Number, Settings
from controller.base.errors import ConfigError
from controller.base.parameters import did_you_mean

if TYPE_CHECKING:
    from controller.stage.heads import HeadSettings  # as Stage
    from controller.stage.stage import Stage  # it has this table

ROLES = ("conductor", "head", "face", "recorder")
"""Mixes and publishes; drives servos; draws; writes what was published to files."""
Role = Literal["conductor", "head", "face", "recorder"]
Endpoint = Annotated[str, Field(pattern=r"^(tcp|tls|udp|quic|unixsock-stream)/.+$")]


class TlsSettings(Settings):
    """Certificates in PEM files, relative to the stage's folder. With ``mutual`` each side must show one."""

    ca: str
    certificate: str | None = None
    key: str | None = None
    mutual: bool = True

    @model_validator(mode="after")
    def _fits(self) -> TlsSettings:
        if (self.certificate is None) != (self.key is None):
            raise ValueError("certificate and key go together")
        return self


class ZenohSettings(Settings):
    """The contents of ``[zenoh]``; see docs/many-heads.md."""

    role: Role = "conductor"
    heads: Annotated[list[str], Field(max_length=256)] = []
    mode: Literal["auto", "peer", "client", "router"] = "auto"
    connect: Annotated[list[Endpoint], Field(max_length=64)] = []
    listen: Annotated[list[Endpoint], Field(max_length=64)] = []
    prefix: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+(/[A-Za-z0-9_-]+)*$", max_length=128)] = "omote"
    payload: Literal["exact", "binary", "json"] = "exact"
    lease_ms: Annotated[Number, Field(ge=100, le=10_000)] = 250.0
    delay_ms: Annotated[Number, Field(ge=0, le=1000)] = 0.0
    record: str = "recorded"
    shared_memory: bool = False
    open_to_network: bool = False
    tls: TlsSettings | None = None
    config: str | None = None

    @property
    def way(self) -> str:
        """The mode of Zenoh: who listens routes between those that connect, who only connects is a client."""
        return self.mode if self.mode != "auto" else "router" if self.listen else "client"

    @field_validator("prefix")
    @classmethod
    def _no_edges(cls, value: str) -> str:
        return value.strip("/")

    @model_validator(mode="after")
    def _fits(self) -> ZenohSettings:
        if not self.connect and not self.listen and self.config is None:
            raise ValueError('give listen or connect, as listen = ["tcp/127.0.0.1:7447"]: nothing is searched for')
        far = [each for each in self.listen if not _is_local(each)]
        if far and not self.open_to_network:
            raise ValueError(f"listen: others can reach {far[0]}; set open_to_network = true where they shall")
        return self


def _is_local(endpoint: str) -> bool:
    protocol, _, address = endpoint.partition("/")
    host = address.rpartition(":")[0].strip("[]")
    return protocol == "unixsock-stream" or host in ("localhost", "::1") or host.startswith("127.")


def with_role(settings: ZenohSettings, role: str | None, heads: Sequence[str]) -> ZenohSettings:
    """The table with the options of a command line over it. Raises ConfigError: no such role."""
    if role is not None and role not in ROLES:
        raise ConfigError(f"--role {role}: no such role{did_you_mean(role, ROLES)}", hint=f"roles: {', '.join(ROLES)}")
    wanted: dict[str, object] = {"role": role} if role is not None else {}
    return settings.model_copy(update=wanted | ({"heads": list(heads)} if heads else {}))


def for_role(stage: Stage, role: str | None = None, heads: Sequence[str] = ()) -> Stage:
    """A stage as the process of its role runs it: only a conductor has links and plays things, only a ``head`` drives
    servos, and of the heads those that are its own.

    Raises ConfigError: no such role or head, or the stage has no ``[zenoh]``.
    """
    table = stage.settings.zenoh
    if table is None:
        if role is not None:
            raise ConfigError("--role: the stage has no [zenoh]", hint='[zenoh]\nlisten = ["tcp/127.0.0.1:7447"]')
        return stage
    table = with_role(table, role, heads)
    kept = _chosen(stage, table)
    settings = stage.settings.model_copy(update={"zenoh": table, "heads": kept})
    chosen = {head.name for head in kept}
    own = tuple(replace(head, stage=_stripped(head.stage, table.role)) for head in stage.heads if head.name in chosen)
    return replace(_stripped(replace(stage, settings=settings), table.role), heads=own)


def _chosen(stage: Stage, table: ZenohSettings) -> list[HeadSettings]:
    """The tables of the heads that this process has. Raises ConfigError."""
    known = {head.name.lower(): head for head in stage.settings.heads}
    unknown = [name for name in table.heads if name.lower() not in known]
    if unknown:
        raise ConfigError(f"zenoh.heads: no head called {unknown[0]!r}{did_you_mean(unknown[0], known)}",
                          hint=f"heads of this stage: {', '.join(known) or 'one, without a name'}")  # fmt: skip
    wanted = {name.lower() for name in table.heads}
    return [head for head in stage.settings.heads if not wanted or head.name.lower() in wanted]


def _stripped(stage: Stage, role: str) -> Stage:
    update: dict[str, object] = {}
    if role != "conductor":
        update = {"links": [], "show": None, "take": None, "voice": None, "turns": "manual"}
    robots = stage.robots if role == "head" else ()
    return replace(stage, robots=robots, settings=stage.settings.model_copy(update=update))
