"""Makes a kind of link of each format; a package that adds a format makes the kind of its link in the same way."""

from __future__ import annotations

from controller.formats.format import FORMATS, Format
from controller.links.kind import API, LinkKind
from controller.links.net.settings import NetSettings


def link_of(form: Format) -> LinkKind:
    """The kind of link that takes and sends messages of a format."""
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
    """``LINK_livelink`` and so on: the kind of link of a built-in format."""
    prefix, _, kind = name.partition("LINK_")
    if prefix or kind not in FORMATS.builtin():
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return link_of(FORMATS.get(kind))
