"""Who may connect: tokens, and the origins of web pages."""

from __future__ import annotations

import hmac
import ipaddress
import os
import secrets
from collections.abc import Collection
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from controller.base.errors import LinkError
from surface.base import files

_BYTES = 18
_LONGEST = 256


def state_folder() -> Path:
    """The user's folder for what programs keep between runs (XDG Base Directory Specification), omote's part of it."""
    base = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(base) / "omote"


def make_token() -> tuple[str, Path, bool]:
    """The token of this user: itself, the file it is kept in, and whether it was made just now.

    Raises LinkError: the file cannot be read or written.
    """
    path = state_folder() / "token"
    try:
        kept = files.read_text(path, _LONGEST).strip()
        if kept:
            return kept, path, False
    except FileNotFoundError:
        pass
    except (OSError, ValueError) as error:
        raise LinkError(f"{path}: cannot be read: {error}", hint=f"remove it: rm {path}") from error
    token = secrets.token_urlsafe(_BYTES)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w", encoding="ascii") as stream:
            stream.write(token + "\n")
    except OSError as error:
        raise LinkError(f"{path}: cannot be written: {error.strerror}", hint='set token = "..." in the link') from error
    return token, path, True


def given_token(target: str, authorization: str | None) -> str:
    """The token that a client gives: ``Authorization: Bearer TOKEN``, or ``?token=TOKEN`` in what it asks for."""
    if authorization is not None and authorization.startswith("Bearer "):
        return authorization.removeprefix("Bearer ").strip()
    try:
        return parse_qs(urlsplit(target).query).get("token", [""])[0]
    except ValueError:
        return ""


def same_token(given: str, wanted: str) -> bool:
    """Whether two tokens are the same; takes as long whichever character differs."""
    return hmac.compare_digest(given.encode(), wanted.encode())


def is_own_page(origin: str, allowed: Collection[str]) -> bool:
    """Whether a web page may connect: one that this machine serves, or one of ``allowed``.

    A browser names the page's origin, so that pages from elsewhere cannot reach what listens on this machine.
    """
    if origin in allowed:
        return True
    try:
        host = urlsplit(origin).hostname or ""
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
