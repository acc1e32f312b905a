"""Decides who may connect to a link, by tokens and by the origins of web pages."""

from __future__ import annotations

import hmac
import ipaddress
import logging
import os
import re
import secrets
from collections.abc import Collection
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from controller.base.errors import LinkError
from surface.base import files

log = logging.getLogger(__name__)

MIN_TOKEN_LENGTH = 12
"""Smallest number of characters of a token that a user chooses."""
_TOKEN_BYTES = 18
_MAX_BYTES = 256  # of a token file, and of a line that is kept to find a request in it
_TOKEN = re.compile(r"[!-)+-~]+")
_WEB = re.compile(rb"^(?:host:\s|[^\s:]+ \S+ HTTP/\d)", re.IGNORECASE | re.MULTILINE)


def host_and_port(listen: str, usual: int) -> tuple[str, int]:
    """Return the host and port of an address to listen at; ``usual`` : the port in the error's example.

    Raises ValueError: it is not an address.
    """
    host, colon, port = listen.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not colon or not host or not port.isascii() or not port.isdigit() or int(port) > 65_535:
        raise ValueError(f'listen: {listen!r} is not an address; write it as "127.0.0.1:{usual}"')
    return host, int(port)


def bound_at(listen: str, port: int) -> str:
    """Return an address to listen at with the port that is really bound; the system chooses one for port 0."""
    return f"{listen.rpartition(':')[0]}:{port}"


def is_loopback(host: str) -> bool:
    """Whether only programs on this machine can reach an address."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def check_reach(host: str, token: str | None, *, open_to_network: bool) -> None:
    """Raise ValueError if other machines reach an address without permission, or if a token is too short."""
    if not is_loopback(host) and not open_to_network:
        raise ValueError(
            f"listen: at {host} every machine that reaches this one could try to connect; "
            "open_to_network = true allows it, with a token"
        )
    if token is not None and len(token) < MIN_TOKEN_LENGTH:
        raise ValueError(f"token: needs at least {MIN_TOKEN_LENGTH} characters")


def check_word(token: str) -> None:
    """Raise ValueError if a token is easily guessed, or is not one word of ASCII, as ``AUTH`` needs it."""
    if len(token) < MIN_TOKEN_LENGTH:
        raise ValueError(f"token: needs at least {MIN_TOKEN_LENGTH} characters")
    if not _TOKEN.fullmatch(token):
        raise ValueError("token: must be printable ASCII without spaces and *")


def token_for(name: str, host: str, token: str | None) -> str | None:
    """Return the token that clients of a link need; None if they need none.

    It is the stage's ``token``, or, if other machines can connect, the one that omote stores for this user. The log
    says where that is, and shows it if it is new. Raises LinkError: it cannot be stored.
    """
    if token is not None or is_loopback(host):
        return token
    kept, path, new = make_token()
    log.warning("%s: other machines may move this face and its servos with the token in %s%s",
                name, path, f", which is shown only now: {kept}" if new else "")  # fmt: skip
    return kept


class WebRequests:
    """Detects HTTP requests in the stream of one client.

    A web page can make a browser send text of its choice to any port of this machine. Before that text there are a
    request line and the field ``Host``, neither of which a page can leave out.
    """

    def __init__(self) -> None:
        self._line = b""

    def begins(self, data: bytes) -> bool:
        """Whether a request begins in the next piece of the stream."""
        seen = self._line + data
        self._line = seen[seen.rfind(b"\n") + 1 :][:_MAX_BYTES]
        return _WEB.search(seen) is not None


def state_folder() -> Path:
    """Return omote's folder for state that is kept between runs (XDG Base Directory Specification)."""
    base = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(base) / "omote"


def make_token() -> tuple[str, Path, bool]:
    """Return the stored token of this user, creating one if there is none, its file, and whether it is new.

    Raises LinkError: the file cannot be read or written.
    """
    path = state_folder() / "token"
    try:
        kept = files.read_text(path, _MAX_BYTES).strip()
        if kept:
            return kept, path, False
    except FileNotFoundError:
        pass
    except (OSError, ValueError) as error:
        raise LinkError(f"{path}: cannot be read: {error}", hint=f"remove it: rm {path}") from error
    token = secrets.token_urlsafe(_TOKEN_BYTES)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w", encoding="ascii") as stream:
            stream.write(token + "\n")
    except OSError as error:
        raise LinkError(f"{path}: cannot be written: {error.strerror}", hint='set token = "..." in the link') from error
    return token, path, True


def given_token(target: str, authorization: str | None) -> str:
    """Return the token of a request: ``Authorization: Bearer TOKEN``, or ``?token=TOKEN`` in its target; else empty."""
    if authorization is not None and authorization.startswith("Bearer "):
        return authorization.removeprefix("Bearer ").strip()
    try:
        return parse_qs(urlsplit(target).query).get("token", [""])[0]
    except ValueError:
        return ""


def same_token(given: str, wanted: str) -> bool:
    """Whether two tokens are the same, compared in constant time."""
    return hmac.compare_digest(given.encode(), wanted.encode())


def is_own_page(origin: str, allowed: Collection[str]) -> bool:
    """Whether a web page may connect: one that this machine serves, or one in ``allowed``.

    The browser states the page's origin, which keeps pages from elsewhere away from what listens on this machine.
    """
    if origin in allowed:
        return True
    try:
        host = urlsplit(origin).hostname or ""
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
