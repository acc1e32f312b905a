"""Draws the texture of a head's skin and eyes, which its mesh brought."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import TYPE_CHECKING

from surface.base.errors import ViewError
from surface.base.pictures import decoded
from surface.head.model.texture import HINT, HeadTexture
from surface.view.draw.programs import set_uniforms
from surface.view.scene.parts import ViewHead
from surface.view.scene.theme import Theme

if TYPE_CHECKING:
    import moderngl

log = logging.getLogger(__name__)
TEXTURE_UNIT = 4


@dataclass(frozen=True)
class DrawnTexture:
    """A head's texture on an OpenGL context."""

    texture: moderngl.Texture
    own: HeadTexture

    def set_uniforms(self, program: moderngl.Program) -> None:
        """Let a program draw it."""
        set_uniforms(program, {"head_texture": TEXTURE_UNIT, "texture_tone": self.own.colour})

    def simplify(self) -> None:
        """Do not mix it between its sizes, for pictures drawn in software."""
        self.texture.filter = (self.texture.ctx.LINEAR_MIPMAP_NEAREST, self.texture.ctx.LINEAR)


def texture_of(ctx: moderngl.Context, head: ViewHead, theme: Theme) -> DrawnTexture | None:
    """A head's texture, with smaller versions of it; None where it has none, or a theme has its own colours. One that
    cannot be read is not drawn; a warning is logged."""
    own: HeadTexture | None = getattr(head, "texture", None)
    if own is None or not theme.use_painted:
        return None
    try:
        size, pixels = decoded_texture(own, ctx.info["GL_MAX_TEXTURE_SIZE"])
    except ViewError as error:
        log.warning("%s: skin and irises are drawn in one colour; %s", error, error.hint)
        return None
    texture = ctx.texture(size, 3, pixels, alignment=1)
    texture.build_mipmaps()
    texture.filter = (ctx.LINEAR_MIPMAP_LINEAR, ctx.LINEAR)
    texture.repeat_x = texture.repeat_y = False
    return DrawnTexture(texture, own)


def decoded_texture(own: HeadTexture, most: int) -> tuple[tuple[int, int], bytes]:
    """Width, height and RGB bytes of a texture, top row first.

    Raises ViewError: it is damaged, or has more than ``most`` pixels in a side, or too many in all, or Pillow is not
    installed.
    """
    try:
        image = decoded(own.picture)
    except ImportError as error:
        raise ViewError("the head's texture needs Pillow", hint="pip install 'omote[view]'") from error
    except ValueError as error:
        raise ViewError(f"the head's texture cannot be read ({error})", hint=HINT) from error
    if max(image.size) > most:
        raise ViewError(f"the head's texture has {max(image.size)} pixels in a side, {most} are the most here",
                        hint=HINT)  # fmt: skip
    return image.size, image.convert("RGB").tobytes()
