"""Where a browser finds the panel, for people: an address, and a picture of it that a phone's camera reads."""

from __future__ import annotations

import logging
import socket
import sys
from io import StringIO

log = logging.getLogger(__name__)


def announce(host: str, port: int, token: str | None) -> None:
    """Say where the panel is; where other machines reach it, also as a QR code on the terminal."""
    url = address(host, port, token)
    log.warning("web panel: %s", url)
    code = qr_code(url) if token is not None else ""
    if code and sys.stderr is not None and sys.stderr.isatty():
        sys.stderr.write(code)


def address(host: str, port: int, token: str | None) -> str:
    """The panel's URL. The token stands behind a #, which browsers send to nobody."""
    name = own_address() if host in ("0.0.0.0", "::") else host
    name = f"[{name}]" if ":" in name else name
    return f"http://{name}:{port}/" + (f"#token={token}" if token is not None else "")


def own_address() -> str:
    """The address at which other machines most likely reach this one; nothing is sent to find it."""
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.connect(("192.0.2.1", 9))  # an address for documentation (RFC 5737): it only chooses a route
            return str(probe.getsockname()[0])
    except OSError:
        return socket.gethostname()


def qr_code(text: str) -> str:
    """A QR code of block characters; empty without the package segno."""
    try:
        import segno  # optional
    except ImportError:
        return ""
    out = StringIO()
    segno.make(text, error="l", micro=False).terminal(out, compact=True)
    return out.getvalue()
