"""Find textures of accessories that cannot be drawn."""

from __future__ import annotations

from collections.abc import Iterator

from surface.base.pictures import decoded
from surface.check.findings import Finding
from surface.head import Head

HINT = "repair the picture, then omote fit MESH -o {folder}; or leave the piece out with --without NAME"


def damaged_textures(head: Head) -> Iterator[Finding]:
    """Find accessories whose texture is damaged or too large; none without Pillow, which draws them."""
    for worn in head.accessories:
        own = worn.accessory
        try:
            if own.texture:
                decoded(own.texture)
        except ImportError:
            return
        except ValueError as error:
            yield Finding("damaged texture", f"{own.kind} {own.name!r} is drawn without its texture: {error}", HINT)
