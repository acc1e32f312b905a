"""Answers browsers with the panel's own files, from a fixed list, and with the face; no other file is served."""

from __future__ import annotations

import gzip
import hashlib
import ipaddress
from functools import cache, lru_cache
from http import HTTPStatus
from pathlib import Path

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from surface.base import files

STATIC = Path(__file__).with_name("static")
MAX_FILE_BYTES, MAX_FACE_BYTES = 4 << 20, 64 << 20
_MAX_TAGS_LENGTH = 2000
_SCRIPTS = (
    "panel.js", "robot.js", "face.js", "morph.js", "shaders.js", "pose.js", "controls.js", "pads.js", "servos.js",
    "plot.js", "three.min.js",
)  # fmt: skip
FILES = {
    "/": ("index.html", "text/html; charset=utf-8"),
    "/panel.css": ("panel.css", "text/css; charset=utf-8"),
    "/icon.svg": ("icon.svg", "image/svg+xml"),
    **{f"/{name}": (name, "text/javascript; charset=utf-8") for name in _SCRIPTS},
    "/three.LICENSE.txt": ("three.LICENSE.txt", "text/plain; charset=utf-8"),
}
"""File name and media type by path."""
SECURITY_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
        "connect-src 'self' blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-cache",
}
"""Headers of every answer."""


@cache
def packed(name: str) -> bytes:
    """Return a file of ``static``, compressed with gzip."""
    return gzip.compress(files.read_file(STATIC / name, MAX_FILE_BYTES), 6, mtime=0)


def page(path: str, known: str | None = None) -> Response:
    """Return the answer to a request for one of the panel's own files; not found for everything else.

    known : the request's If-None-Match; a file that it names is not sent again.
    """
    if path not in FILES:
        return text(HTTPStatus.NOT_FOUND, f"there is no {path[:80]} here; the panel is at /")
    name, kind = FILES[path]
    return _file(packed(name), kind, known)


class Face:
    """The file of the face, which may appear after the server has started; it is read once."""

    def __init__(self, path: Path | None) -> None:
        self._path, self._packed = path, b""

    def answer(self, known: str | None = None) -> Response:
        """Return the answer to a request for the face; if it is not there yet, the answer says when to try again.

        known : the request's If-None-Match; a face that it names is not sent again.
        """
        if not self._packed and self._path is not None and self._path.is_file():
            raw = files.read_file(self._path, MAX_FACE_BYTES)
            self._packed = raw if raw[:2] == b"\x1f\x8b" else gzip.compress(raw, 6, mtime=0)
        if self._packed:
            return _file(self._packed, "model/gltf-binary", known)
        if self._path is None:
            return text(HTTPStatus.NOT_FOUND, 'no face is served here; set face = "head.glb" in the link')
        answer = text(HTTPStatus.SERVICE_UNAVAILABLE, "the face is being prepared")
        answer.headers["Retry-After"] = "1"
        return answer


def text(status: HTTPStatus, words: str) -> Response:
    """Return a short answer for people."""
    return _answer(status, (words + "\n").encode(), "text/plain; charset=utf-8")


def is_local_name(request: Request) -> bool:
    """Whether a request names this machine by an IP address or as localhost.

    This refuses pages whose host name an attacker's name server resolves to this machine (DNS rebinding).
    """
    host = (request.headers.get("Host") or "").rpartition("@")[2]
    name = host[1:].partition("]")[0] if host.startswith("[") else host.partition(":")[0]
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return name == "localhost"
    return True


@lru_cache(maxsize=64)
def entity_tag(body: bytes) -> str:
    """Return the strong entity tag of a compressed file, by its content (RFC 9110, 8.8.3)."""
    return f'"{hashlib.sha256(body).hexdigest()[:32]}"'


def _file(body: bytes, kind: str, known: str | None) -> Response:
    """Return a compressed file with its entity tag, or 304 without a body if the browser has it (RFC 9110, 13.1.2)."""
    tag = entity_tag(body)
    if known is not None and _names(known, tag):
        answer = _answer(HTTPStatus.NOT_MODIFIED, b"", kind)
        del answer.headers["Content-Length"]  # of a 304 it would be that of the file
    else:
        answer = _answer(HTTPStatus.OK, body, kind, zipped=True)
    answer.headers["ETag"] = tag
    return answer


def _names(known: str, tag: str) -> bool:
    """Whether a list of entity tags, or ``*``, names this one, by the weak comparison."""
    return any(each.strip().removeprefix("W/") in ("*", tag) for each in known[:_MAX_TAGS_LENGTH].split(","))


def _answer(status: HTTPStatus, body: bytes, kind: str, *, zipped: bool = False) -> Response:
    length = str(len(body))
    headers = Headers({"Content-Type": kind, "Content-Length": length, "Connection": "close", **SECURITY_HEADERS})
    if zipped:
        headers["Content-Encoding"] = "gzip"
    return Response(status.value, status.phrase, headers, body)
