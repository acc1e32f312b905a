"""Draws a head: one program per material, three lights, a gradient behind.

The shading runs in linear light and is encoded for the display at the end of each shader. What is drawn
in front comes first, so that the depth test spares the software renderer the shading behind it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from surface.base.errors import ViewError
from surface.view.draw import materials
from surface.view.draw.evaluator import choose
from surface.view.draw.programs import put
from surface.view.scene.bounds import Bands, Silhouette, corners
from surface.view.scene.camera import Camera
from surface.view.scene.openings import Openings
from surface.view.scene.parts import PartBuffers, ViewHead, ViewPart
from surface.view.scene.theme import THEMES, Colour, Light, Theme

if TYPE_CHECKING:
    import moderngl

    from surface.view.draw.decimated_draw import DecimatedDrawn

QUALITIES = ("full", "fast")
_LOW_DEG = -12.0  # from further below, as from behind, the bust is seen to be hollow


class Renderer:
    """A head on an OpenGL context (3.1 or newer).

    The head is put to rest (all parameters 0) once, to find lids and lips.

    Parameters
    ----------
    ctx : the moderngl context that is current.
    head : anything with the parts of `surface.view.scene.parts.ViewHead`.
    quality : "full" shades skin and mouth per pixel, "fast" per vertex.
    theme : name in `surface.view.scene.theme.THEMES`, or a :class:`Theme`.
    evaluator : who works out the vertices: "cpu", "gpu", or "auto" (see :func:`surface.view.draw.evaluator.choose`).

    Raises
    ------
    ValueError : unknown quality or evaluator.
    ViewError : unknown theme, the driver refuses a shader, or evaluator "gpu" cannot be had.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        head: ViewHead,
        *,
        quality: str = "full",
        theme: str | Theme = "skin",
        evaluator: str = "auto",
    ) -> None:
        if quality not in QUALITIES:
            raise ValueError(f"quality must be one of {', '.join(QUALITIES)}, not {quality!r}")
        self.ctx, self.head, self.quality = ctx, head, quality
        self.theme = theme_named(theme)
        head.pose(np.zeros(len(head.parameters)))
        self.evaluator = choose(ctx, head, evaluator)
        self.evaluator.pose(np.zeros(len(head.parameters)))
        self.openings = Openings(head.parts, self.evaluator.positions)
        self._programs = materials.programs(ctx, quality, self.theme)
        self._detail = materials.detail_texture(ctx)
        self._background = Rectangles(ctx, self._programs["background"])
        parts = sorted(head.parts, key=lambda part: materials.order(part.material))
        self._hurried = False
        self._posed = np.zeros(len(head.parameters))
        self._static: dict[str, materials.Arrays] = {part.name: self._shown(part) for part in parts}
        self._parts: list[PartBuffers] | list[DecimatedDrawn] = [self._buffers(part) for part in parts]
        self._camera: tuple[Camera, float] | None = None
        self._into_bust = False
        #: Grows with every upload: equal revisions, cameras and themes draw equal pictures.
        self.revision = 0
        self._apply_theme()

    def _shown(self, part: ViewPart) -> materials.Arrays:
        """What the part's material reads, as the part is at rest: later the face may have moved."""
        return materials.of(part.material).static(part, self.theme, self.openings)

    def _buffers(self, part: ViewPart) -> PartBuffers:
        """Buffers of `part` with what its material reads."""
        program = self._programs[materials.of(part.material).program]
        elsewhere = self.evaluator.name == "gpu"
        return PartBuffers(self.ctx, part, program, self._static[part.name], interleaved=elsewhere)

    def hurry(self) -> None:
        """From now on pictures move and are drawn in software: leave out what costs much and shows little.

        From then on the head's own vertices stay where they are, as they do where the graphics processor evaluates.
        """
        if self._hurried or self.evaluator.name != "cpu":
            return
        self._hurried, old = True, self._programs["skin"]
        self._programs["skin"] = materials.skin_program(self.ctx, self.quality, self.theme, hurried=True)
        for buffers in self._parts:
            buffers.release()
        old.release()
        self._parts = self._decimated_parts() or [self._buffers(buffers.part) for buffers in self._parts]
        self._camera = None
        self._apply_theme()

    def _decimated_parts(self) -> list[DecimatedDrawn]:
        """The head's decimated triangles, evaluated for themselves; none where it has none."""
        if not any(getattr(part, "decimated", None) for part in self.head.parts):
            return []
        from surface.view.draw.decimated_draw import (  # compiled: loaded when first used
            DecimatedEvaluator,
            decimated_drawn,
        )

        decimated: Any = DecimatedEvaluator(self.head, self.quality, self.openings, self.evaluator.reason)  # type: ignore[arg-type]
        decimated.pose(self._posed)
        self.evaluator = decimated
        self.openings.read_by(decimated.positions)
        return decimated_drawn(self.ctx, decimated.decimated, self._programs, lambda part: self._static[part.name])

    def pose(self, values: np.ndarray) -> None:
        """Move the head to parameter values (P,)."""
        self.evaluator.pose(values)
        self._posed = np.array(values, float)

    def update(self) -> int:
        """Bring the buffers up to date with the last :meth:`pose`, once after each. Returns vertices changed."""
        self.openings.refresh()
        sent = self.evaluator.update(self._parts)
        self.revision += sent > 0
        return sent

    def draw(self, camera: Camera, target: moderngl.Framebuffer, bands: Bands | None = None) -> None:
        """Draw the head into `target`, and round it the background: everywhere, or only within `bands`, which hold
        the head."""
        width, height = target.size
        target.scissor = 0, 0, width, height
        target.use()
        # Colours stay: what was drawn before and is not covered now is background.
        target.depth_mask, target.color_mask = True, (False, False, False, False)
        target.clear(depth=1.0)
        target.color_mask = True, True, True, True
        target.use()  # again: it brings the masks to OpenGL
        self.ctx.viewport = (0, 0, width, height)
        self.ctx.depth_func = "<="
        self.ctx.blend_func = self.ctx.SRC_ALPHA, self.ctx.ONE_MINUS_SRC_ALPHA
        self._aim(camera, width / max(height, 1))
        self._turn_lights(camera)
        self._detail.use(0)
        for buffers in self._parts:
            self._draw_part(buffers)
        self.ctx.enable_only(self.ctx.DEPTH_TEST)
        theme = self.theme
        put(self._programs["background"], {"top": theme.background_top, "bottom": theme.background_bottom})
        self._background.render(corners((bands or Bands.whole(target.size)).boxes(), target.size))

    def region(self, camera: Camera, size: tuple[int, int]) -> Bands:
        """Where a picture of `size` can be touched by the head, as posed now."""
        found = Silhouette(size, camera.matrix(size[0] / size[1]), camera.near)
        outer = [p for p in self._parts if p.part.material not in materials.INSIDE] or self._parts
        for outline in (drawn.outline() for drawn in outer):
            if outline is None or not found.add(*outline):
                return Bands.whole(size)
        return found.bands()

    def set_background(self, top: Colour, bottom: Colour) -> None:
        """Change the gradient; sRGB colours 0..1."""
        self.theme = replace(self.theme, background_top=top, background_bottom=bottom)

    def _draw_part(self, buffers: PartBuffers | DecimatedDrawn) -> None:
        """One part with its material's uniforms and culling."""
        part = buffers.part
        material = materials.of(part.material)
        put(self._programs[material.program], material.uniforms(part, self.theme, self.openings))
        flags = self.ctx.DEPTH_TEST
        hollow = self._into_bust and material.program == "skin"
        flags |= 0 if material.two_sided or hollow else self.ctx.CULL_FACE
        flags |= self.ctx.BLEND if material.blended else 0
        self.ctx.enable_only(flags)
        buffers.draw()

    def _apply_theme(self) -> None:
        """Uniforms that hold until the theme changes."""
        theme = self.theme
        shared = {
            "key_colour": theme.key.colour,
            "fill_colour": theme.fill.colour,
            "rim_colour": theme.rim.colour,
            "sky": theme.sky,
            "ground": theme.ground,
            "detail": 0,
        }
        for program in self._programs.values():
            put(program, shared)

    def _turn_lights(self, camera: Camera) -> None:
        """The lights as the head at rest would see them, for what was baked there."""
        turn, back = self.theme.lights_follow * camera.yaw_deg, self.evaluator.rotation().T
        at_rest = {
            "key_at_rest": back @ light_direction(self.theme.key, turn),
            "rim_at_rest": back @ light_direction(self.theme.rim, turn),
        }
        put(self._programs["skin"], at_rest)

    def _aim(self, camera: Camera, aspect: float) -> None:
        """Camera and light uniforms, sent only when the camera or the picture's shape changed."""
        if self._camera == (camera, aspect):
            return
        self._camera = (camera, aspect)
        self._into_bust = camera.eye[2] < 0.0 or camera.pitch_deg < _LOW_DEG
        turn = self.theme.lights_follow * camera.yaw_deg
        shared = {
            "view_projection": camera.matrix(aspect),
            "camera": camera.eye,
            "key_direction": light_direction(self.theme.key, turn),
            "fill_direction": light_direction(self.theme.fill, turn),
            "rim_direction": light_direction(self.theme.rim, turn),
        }
        for program in self._programs.values():
            put(program, shared)

    def release(self) -> None:
        """Give back every buffer and program."""
        for buffers in self._parts:
            buffers.release()
        self.evaluator.release()
        self._background.release()
        self._detail.release()
        for program in self._programs.values():
            program.release()


class Rectangles:
    """Rectangles of a picture, to run a fragment shader over.

    Parameters
    ----------
    program : with an input `corner`, as in background.vert.
    """

    def __init__(self, ctx: moderngl.Context, program: moderngl.Program) -> None:
        self._ctx, self._program = ctx, program
        self._make(1024)

    def _make(self, room: int) -> None:
        self._corners = self._ctx.buffer(reserve=room, dynamic=True)
        self._array = self._ctx.vertex_array(self._program, [(self._corners, "2f", "corner")])
        self._ctx.clear_errors()  # moderngl sets a divisor, which OpenGL 3.1 does not have

    def render(self, at: np.ndarray) -> None:
        """Draw the triangles whose corners `at` (k, 2) float32 lists."""
        if at.nbytes > self._corners.size:
            self.release()
            self._make(at.nbytes)
        self._corners.orphan()
        self._corners.write(at.tobytes())
        self._array.render(vertices=len(at))

    def release(self) -> None:
        """Give the buffer back."""
        self._array.release()
        self._corners.release()


def theme_named(theme: str | Theme) -> Theme:
    """The theme of that name, or `theme` itself; ViewError for an unknown name."""
    if isinstance(theme, Theme):
        return theme
    if theme not in THEMES:
        raise ViewError(f"there is no theme {theme!r}", hint=f"themes: {', '.join(sorted(THEMES))}")
    return THEMES[theme]


def light_direction(light: Light, turn_deg: float) -> np.ndarray:
    """Unit vector (3,) towards `light`, turned about y by `turn_deg`."""
    yaw, pitch = np.radians(light.yaw_deg + turn_deg), np.radians(light.pitch_deg)
    return np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)], np.float32)
