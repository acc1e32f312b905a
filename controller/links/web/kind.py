"""Defines the link kind ``web``, which serves the web panel."""

from __future__ import annotations

from dataclasses import dataclass

from controller.links.kind import LinkKind
from controller.links.websocket.kind import WebSocketSettings
from drivers.base.options import option

PORT = 8080


@dataclass(frozen=True, kw_only=True)
class WebSettings(WebSocketSettings):
    """Options of the link in a stage file: those of the WebSocket link, and the face."""

    listen: str = option("HOST:PORT at which browsers open the panel.", f"127.0.0.1:{PORT}")
    face: str | None = option("File with the face, as omote export FILE.glb --web writes it.", longest=4096)


LINK = LinkKind(
    api=1,
    kind="web",
    title="a panel for browsers, with the WebSocket API under /ws",
    settings=WebSettings,
    open="controller.links.web.server:open_web",
    install="omote[web]",
)
