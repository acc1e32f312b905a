"""Find textures of a head and of its accessories that cannot be drawn."""

from __future__ import annotations

from collections.abc import Iterator

from surface.base.pictures import decoded
from surface.check.findings import Finding
from surface.head import Head
from surface.head.model.texture import FILE

HINT = "repair the picture, then omote fit MESH -o {folder}; or leave the piece out with --without NAME"
OWN_HINT = f"fit the head again, or delete {{folder}}/{FILE}, and skin and irises are drawn in one colour"


def damaged_textures(head: Head) -> Iterator[Finding]:
    """Find textures that are damaged or too large; none without Pillow, which draws them."""
    if head.texture is not None:
        try:
            decoded(head.texture.picture)
        except ImportError:
            return
        except ValueError as error:
            yield Finding("damaged texture", f"skin and eyes are drawn without their texture: {error}", OWN_HINT)
    for worn in head.accessories:
        own = worn.accessory
        try:
            if own.texture:
                decoded(own.texture)
        except ImportError:
            return
        except ValueError as error:
            yield Finding("damaged texture", f"{own.kind} {own.name!r} is drawn without its texture: {error}", HINT)
