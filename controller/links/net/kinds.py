"""Makes a link kind from each format; a package that adds a format makes its link kind in the same way."""

from __future__ import annotations

from controller.formats.format import FORMATS, Format
from controller.links.kind import API, LinkKind
from controller.links.net.settings import NetSettings


def link_of(form: Format) -> LinkKind:
    """Return the link kind that receives and sends messages of a format."""
    settings = type("NetSettings", (NetSettings,), {"form": form, "__module__": __name__})
    return LinkKind(
        api=API,
        kind=form.kind,
        title=form.title,
        settings=settings,
        open="controller.links.net.link:open_net",
        install=form.install,
    )


def __getattr__(name: str) -> LinkKind:
    """Return the link kind of a built-in format for ``LINK_livelink`` and so on."""
    prefix, _, kind = name.partition("LINK_")
    if prefix or kind not in FORMATS.builtin():
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return link_of(FORMATS.get(kind))
