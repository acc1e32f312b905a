"""Tells people where a browser finds the panel: as an address, and as a QR code for a phone's camera."""

from __future__ import annotations

import logging
import socket
import sys
from io import StringIO

log = logging.getLogger(__name__)


def announce(host: str, port: int, token: str | None) -> None:
    """Log the panel's address; if a token is needed, also show it as a QR code on the terminal."""
    url = address(host, port, token)
    log.warning("web panel: %s", url)
    code = qr_code(url) if token is not None else ""
    if code and sys.stderr is not None and sys.stderr.isatty():
        sys.stderr.write(code)


def address(host: str, port: int, token: str | None) -> str:
    """Return the panel's URL. The token is in the fragment (after #), which browsers do not send to servers."""
    name = own_address() if host in ("0.0.0.0", "::") else host
    name = f"[{name}]" if ":" in name else name
    return f"http://{name}:{port}/" + (f"#token={token}" if token is not None else "")


def own_address() -> str:
    """Return the address at which other machines most likely reach this one, without sending anything."""
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.connect(("192.0.2.1", 9))  # an address for documentation (RFC 5737), only used to choose a route
            return str(probe.getsockname()[0])
    except OSError:
        return socket.gethostname()


def qr_code(text: str) -> str:
    """Return a QR code in block characters; empty if the package segno is not installed."""
    try:
        import segno  # optional
    except ImportError:
        return ""
    out = StringIO()
    segno.make(text, error="l", micro=False).terminal(out, compact=True)
    return out.getvalue()
