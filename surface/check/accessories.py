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
    worn = (one.accessory for one in head.accessories)
    pictures = [(own.texture, f"{own.kind} {own.name!r} is", "its", HINT) for own in worn]
    if head.texture is not None:
        pictures.insert(0, (head.texture.picture, "skin and eyes are", "their", OWN_HINT))
    for data, what, whose, hint in pictures:
        try:
            if data:
                decoded(data)
        except ImportError:
            return
        except ValueError as error:
            yield Finding("damaged texture", f"{what} drawn without {whose} texture: {error}", hint)
