"""Opens a Zenoh session with explicit endpoints only, and with TLS and access control if the stage sets them."""

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

_CONNECT_TIMEOUT_S = 20.0
"""Time that a client waits for its router before it reports an error."""
_ATTEMPT_TIMEOUT_MS = 4_000
"""Time that it waits with one session before it opens another one. If the last message of the handshake is lost, the
router refuses that session as a duplicate for 10 s."""
_RETRY = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2}
"""Pauses between attempts to reach a router that has gone; Zenoh's default would grow to 4 s."""
_HANDSHAKE_TIMEOUT_MS = 2_000
"""Longest duration of a router's handshake. A router that is ending may accept a connection and not answer, and
Zenoh's default of 10 s would be lost."""
_REOPEN_TIMEOUT_MS, _REOPEN_HANDSHAKE_TIMEOUT_MS = 1_800, 600
"""The same limits for a session that replaces one without answers; several attempts fit, as messages may be lost."""
_NO_ROUTER_HINT = "start a router there, as zenohd -l tcp/0.0.0.0:7447, or correct [zenoh] connect"


def open_session(settings: ZenohSettings, beside: Path, *, again: bool = False) -> zenoh.Session:
    """Open a session with the settings of a stage's ``[zenoh]``.

    beside : the stage's file, to whose folder other files are relative. again : open another session, to replace one
    that gets no answers; takes 2 s at most.

    Raises LinkError: an endpoint cannot be used, or a file of certificates or settings cannot be read. MissingPackage:
    Zenoh is not installed.
    """
    with importing("heads in several processes", "zenoh"):
        import zenoh  # optional: the extra zenoh
    zenoh.init_log_from_env_or("error")
    where = ", ".join([*settings.listen, *settings.connect]) or str(settings.config)
    waits = settings.way == "client" and not again
    give_up_s = time.monotonic() + (_CONNECT_TIMEOUT_S if waits else 0.0)
    while True:
        try:
            return zenoh.open(_configuration(settings, beside.parent, again))
        except zenoh.ZError as error:
            why = str(error).partition(" at ")[0]
            if "connect" in why and time.monotonic() < give_up_s:
                time.sleep(1e-3 * _RETRY["period_init_ms"])
                continue
            hint = _NO_ROUTER_HINT if "connect" in why else "check whether another program uses the port: ss -ltnp"
            raise LinkError(f"zenoh at {where}: {why}", hint=hint) from error


def _configuration(settings: ZenohSettings, folder: Path, again: bool) -> zenoh.Config:
    import zenoh  # optional: the extra zenoh

    own = None if settings.config is None else _file(folder, settings.config, "zenoh.config")
    config = zenoh.Config() if own is None else zenoh.Config.from_file(str(own))
    for key, value in _entries(settings, folder, again).items():
        config.insert_json5(key, json.dumps(value))
    return config


def _entries(settings: ZenohSettings, folder: Path, again: bool) -> dict[str, object]:
    """Return the settings as Zenoh's keys, with discovery off: no multicast, and gossip connects to nobody."""
    connect_ms, open_ms = _ATTEMPT_TIMEOUT_MS, _HANDSHAKE_TIMEOUT_MS
    if again:
        connect_ms, open_ms = _REOPEN_TIMEOUT_MS, _REOPEN_HANDSHAKE_TIMEOUT_MS
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
    """Return the path of a file that the table names. Raises LinkError: it cannot be read."""
    path = folder / name
    if not os.access(path, os.R_OK):
        raise LinkError(f"{key}: {path} cannot be read", hint=f"look at: ls -l {path}")
    return path
