"""Serves the web panel and the WebSocket API at one address."""

from __future__ import annotations

import asyncio
import logging
from http import HTTPStatus
from pathlib import Path
from urllib.parse import urlsplit
from weakref import WeakSet

from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from controller.layers.commands import CommandSink
from controller.links.access import given_token, make_token, same_token
from controller.links.kind import LinkContext
from controller.links.web.address import announce
from controller.links.web.kind import WebSettings
from controller.links.web.pages import Face, is_local_name, page, text
from controller.links.websocket.server import WebSocketLink

log = logging.getLogger(__name__)

SOCKET = "/ws"
_MAX_DOWNLOADS = 32
"""Number of files that may be in flight at the same time."""


def open_web(settings: WebSettings, context: LinkContext) -> WebLink:
    """Serve the panel, and log its address.

    Raises LinkError: the address cannot be used, or the token cannot be stored.
    """
    token = settings.token or (make_token()[0] if settings.needs_token else None)
    face = Path(settings.face) if settings.face is not None else None
    if face is not None and context.beside is not None:
        face = context.beside.parent / face
    link = WebLink(settings, context.sink, token, Face(face))
    context.closers.callback(link.stop)
    link.start()
    announce(settings.where[0], link.port, token)
    return link


class WebLink(WebSocketLink):
    """The server of a web panel."""

    download_s = 60.0  # for a whole file, over a slow network

    def __init__(self, settings: WebSettings, sink: CommandSink, token: str | None, face: Face) -> None:
        super().__init__(settings, sink, token)
        self._face = face
        self._downloads: WeakSet[ServerConnection] = WeakSet()

    def _admit(self, connection: ServerConnection, request: Request) -> Response | None:
        path = urlsplit(request.path[:2000]).path
        if self._token is None and not is_local_name(request):
            self._turned_away["name"] += 1
            return text(HTTPStatus.FORBIDDEN, "open the panel by this machine's address, as http://127.0.0.1")
        if path == SOCKET:
            return super()._admit(connection, request)
        if len(self._downloads) >= _MAX_DOWNLOADS:
            return text(HTTPStatus.SERVICE_UNAVAILABLE, "too many files are on their way; try again")
        self._downloads.add(connection)
        return self._face_for(request) if path == "/face.glb" else page(path, _known(request))

    def _face_for(self, request: Request) -> Response:
        if self._token is not None:
            given = given_token(request.path, request.headers.get("Authorization"))
            if not same_token(given, self._token):
                self._turned_away["token"] += 1
                return text(HTTPStatus.UNAUTHORIZED, "a token is needed: open the address that omote printed")
        return self._face.answer(_known(request))

    async def _leave(self) -> None:
        """Abort downloads that are still in flight."""
        for connection in list(self._downloads):
            connection.transport.abort()
        await asyncio.sleep(0)


def _known(request: Request) -> str | None:
    """Return the entity tags of files that the browser has; None if the request names none."""
    return ",".join(request.headers.get_all("If-None-Match")) or None
