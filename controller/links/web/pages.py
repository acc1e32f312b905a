"""Answers browsers: the panel's own files from a fixed list, and the face; nothing else of the disk is served."""

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

STATIC, LARGEST_FILE = Path(__file__).with_name("static"), 4 << 20
LARGEST_FACE = 64 << 20
"""Bytes of a face that is served."""
_LONGEST_TAGS = 2000
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
"""File and type by path."""
SAFE = {
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
    """A file of ``static``, compressed."""
    return gzip.compress(files.read_file(STATIC / name, LARGEST_FILE), 6, mtime=0)


def page(path: str, known: str | None = None) -> Response:
    """The answer to a request for one of the panel's own files; not found for everything else.

    known : the request's If-None-Match; a file that it names is not sent again.
    """
    if path not in FILES:
        return text(HTTPStatus.NOT_FOUND, f"there is no {path[:80]} here; the panel is at /")
    name, kind = FILES[path]
    return _file(packed(name), kind, known)


class Face:
    """The face's file, which may appear after the server has begun; it is read once."""

    def __init__(self, path: Path | None) -> None:
        self._path, self._packed = path, b""

    def answer(self, known: str | None = None) -> Response:
        """The face; where it is not there yet, when to ask again.

        known : the request's If-None-Match; a face that it names is not sent again.
        """
        if not self._packed and self._path is not None and self._path.is_file():
            raw = files.read_file(self._path, LARGEST_FACE)
            self._packed = raw if raw[:2] == b"\x1f\x8b" else gzip.compress(raw, 6, mtime=0)
        if self._packed:
            return _file(self._packed, "model/gltf-binary", known)
        if self._path is None:
            return text(HTTPStatus.NOT_FOUND, 'no face is served here; set face = "head.glb" in the link')
        answer = text(HTTPStatus.SERVICE_UNAVAILABLE, "the face is being prepared")
        answer.headers["Retry-After"] = "1"
        return answer


def text(status: HTTPStatus, words: str) -> Response:
    """A short answer for people."""
    return _answer(status, (words + "\n").encode(), "text/plain; charset=utf-8")


def is_local_name(request: Request) -> bool:
    """Whether a request names this machine by an address or as localhost: a page whose name was made to lead here by
    somebody else's name server does not."""
    host = (request.headers.get("Host") or "").rpartition("@")[2]
    name = host[1:].partition("]")[0] if host.startswith("[") else host.partition(":")[0]
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return name == "localhost"
    return True


@lru_cache(maxsize=64)
def entity_tag(body: bytes) -> str:
    """The strong entity tag of a compressed file, from its content (RFC 9110, 8.8.3)."""
    return f'"{hashlib.sha256(body).hexdigest()[:32]}"'


def _file(body: bytes, kind: str, known: str | None) -> Response:
    """A compressed file with its entity tag; 304 without a body where the browser has it (RFC 9110, 13.1.2)."""
    tag = entity_tag(body)
    if known is not None and _names(known, tag):
        answer = _answer(HTTPStatus.NOT_MODIFIED, b"", kind)
        del answer.headers["Content-Length"]  # of a 304 it would be that of the file
    else:
        answer = _answer(HTTPStatus.OK, body, kind, zipped=True)
    answer.headers["ETag"] = tag
    return answer


def _names(known: str, tag: str) -> bool:
    """Whether a list of entity tags, or ``*``, names this one; weak ones compare as strong ones do."""
    return any(each.strip().removeprefix("W/") in ("*", tag) for each in known[:_LONGEST_TAGS].split(","))


def _answer(status: HTTPStatus, body: bytes, kind: str, *, zipped: bool = False) -> Response:
    headers = Headers({"Content-Type": kind, "Content-Length": str(len(body)), "Connection": "close", **SAFE})
    if zipped:
        headers["Content-Encoding"] = "gzip"
    return Response(status.value, status.phrase, headers, body)
