"""Opens a session of Zenoh: explicit endpoints only, with TLS and access control where the stage says so."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import TYPE_CHECKING

from controller.base.errors import LinkError
from controller.stage.zenoh import TlsSettings, ZenohSettings
from surface.base.extras import importing

if TYPE_CHECKING:
    import zenoh  # optional: the extra zenoh

_CONNECT_S = 20.0
"""A client waits so long for its router; afterwards whoever started it hears what is missing."""
_TRY_MS = 4_000
"""So long it waits with one session, then with another: where the last message of a router's greeting is lost, the
router refuses that session as one that it has, for 10 s."""
_RETRY = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2}
"""Longest pause between two tries to reach a router that has gone; Zenoh's own would grow to 4 s."""
_OPEN_MS = 2_000
"""Longest time that a router may take to greet; Zenoh's 10 s are lost on one that takes a connection while it ends."""
_AGAIN_MS, _AGAIN_OPEN_MS = 1_800, 600
"""The same for a session beside one that is not answered: several tries, as a greeting may be lost."""
_NO_ROUTER_HINT = "start a router there, as zenohd -l tcp/0.0.0.0:7447, or correct [zenoh] connect"


def open_session(settings: ZenohSettings, beside: Path, *, again: bool = False) -> zenoh.Session:
    """A session by a stage's ``[zenoh]``; ``beside`` : the stage's file, from whose folder other files are named.

    again : another one beside one that is not answered, which takes 2 s at most.

    Raises LinkError: an endpoint cannot be used, or a file of certificates or settings cannot be read. MissingPackage:
    Zenoh is not installed.
    """
    with importing("heads in several processes", "zenoh"):
        import zenoh  # optional: the extra zenoh
    zenoh.init_log_from_env_or("error")
    where = ", ".join([*settings.listen, *settings.connect]) or str(settings.config)
    waits = settings.way == "client" and not again
    give_up_s = time.monotonic() + (_CONNECT_S if waits else 0.0)
    while True:
        try:
            return zenoh.open(_configuration(settings, beside.parent, again))
        except zenoh.ZError as error:
            why = str(error).partition(" at ")[0]
            if "connect" in why and time.monotonic() < give_up_s:
                time.sleep(1e-3 * _RETRY["period_init_ms"])
                continue
            hint = _NO_ROUTER_HINT if "connect" in why else "look whether another program has the port: ss -ltnp"
            raise LinkError(f"zenoh at {where}: {why}", hint=hint) from error


def _configuration(settings: ZenohSettings, folder: Path, again: bool) -> zenoh.Config:
    import zenoh  # optional: the extra zenoh

    own = None if settings.config is None else _file(folder, settings.config, "zenoh.config")
    config = zenoh.Config() if own is None else zenoh.Config.from_file(str(own))
    for key, value in _entries(settings, folder, again).items():
        config.insert_json5(key, json.dumps(value))
    return config


def _entries(settings: ZenohSettings, folder: Path, again: bool) -> dict[str, object]:
    """What the table says, as Zenoh's own keys. Nothing is searched for: no multicast, and gossip connects nobody."""
    connect_ms, open_ms = (_AGAIN_MS, _AGAIN_OPEN_MS) if again else (_TRY_MS, _OPEN_MS)
    found: dict[str, object] = {
        "mode": settings.way,
        "scouting/multicast/enabled": False,
        "scouting/gossip/autoconnect": {"router": [], "peer": []},
        "transport/shared_memory/enabled": settings.shared_memory,
        "timestamping/enabled": False,
        "transport/unicast/open_timeout": open_ms,
    }
    if settings.connect or settings.listen:
        found |= {"connect/endpoints": settings.connect, "listen/endpoints": settings.listen}
    if settings.connect:
        found |= {"connect/timeout_ms": connect_ms, "connect/exit_on_failure": False, "connect/retry": _RETRY}
    return found | (_tls(settings.tls, folder) if settings.tls is not None else {})


def _tls(tls: TlsSettings, folder: Path) -> dict[str, object]:
    base = "transport/link/tls/"
    found: dict[str, object] = {
        base + "root_ca_certificate": str(_file(folder, tls.ca, "zenoh.tls.ca")),
        base + "enable_mtls": tls.mutual,
        base + "verify_name_on_connect": True,
    }
    if tls.certificate is not None and tls.key is not None:
        certificate, key = (
            _file(folder, tls.certificate, "zenoh.tls.certificate"),
            _file(folder, tls.key, "zenoh.tls.key"),
        )
        for side in ("listen", "connect"):
            found |= {f"{base}{side}_certificate": str(certificate), f"{base}{side}_private_key": str(key)}
    return found


def _file(folder: Path, name: str, key: str) -> Path:
    """A file that the table names. Raises LinkError: it cannot be read."""
    path = folder / name
    if not os.access(path, os.R_OK):
        raise LinkError(f"{key}: {path} cannot be read", hint=f"look at: ls -l {path}")
    return path
