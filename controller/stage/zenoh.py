"""The table ``[zenoh]`` of a stage: which part of it this process runs, and how it connects to the others."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from controller.base.config import Number, Settings

ROLES = ("conductor", "head", "face", "recorder")
"""A conductor mixes the layers and publishes faces; a head drives servos; a face draws; a recorder writes files."""
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
        """The mode of Zenoh. For ``auto``, a process that listens is a router, and one that only connects a client."""
        return self.mode if self.mode != "auto" else "router" if self.listen else "client"

    @field_validator("prefix")
    @classmethod
    def _no_edges(cls, value: str) -> str:
        return value.strip("/")

    @model_validator(mode="after")
    def _fits(self) -> ZenohSettings:
        if not self.connect and not self.listen and self.config is None:
            raise ValueError('give listen or connect, as listen = ["tcp/127.0.0.1:7447"]: there is no discovery')
        far = [each for each in self.listen if not _is_local(each)]
        if far and not self.open_to_network:
            raise ValueError(f"listen: other machines can reach {far[0]}; set open_to_network = true to allow that")
        return self


def _is_local(endpoint: str) -> bool:
    protocol, _, address = endpoint.partition("/")
    host = address.rpartition(":")[0].strip("[]")
    return protocol == "unixsock-stream" or host in ("localhost", "::1") or host.startswith("127.")
