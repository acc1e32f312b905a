"""Renderer of a head: one shader program per material, three lights, a gradient as background.

Shading is computed in linear light and encoded for the display at the end of each shader. Parts in front are drawn
first, so that the depth test spares the software renderer the shading of what they hide.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from surface.view.draw import materials
from surface.view.draw.accessories import PROGRAMS, AccessoryBuffers, accessory_programs
from surface.view.draw.evaluator import Evaluator, choose
from surface.view.draw.programs import set_uniforms
from surface.view.draw.textures import TEXTURE_UNIT, texture_of
from surface.view.scene.bounds import Bands, Silhouette, corners
from surface.view.scene.camera import Camera
from surface.view.scene.framing import framing_of
from surface.view.scene.openings import Openings
from surface.view.scene.parts import PartBuffers, ViewHead, ViewPart
from surface.view.scene.theme import Colour, Light, Theme, find_theme
from surface.view.scene.wrinkles import wrinkles_of

if TYPE_CHECKING:
    import moderngl

    from surface.view.draw.decimated_draw import DrawCall

QUALITIES = ("full", "fast")
_ALPHA_TO_COVERAGE = 0x809E  # GL_SAMPLE_ALPHA_TO_COVERAGE, which moderngl does not name
_LOW_DEG = -12.0  # from further below, as from behind, the picture shows that the bust is hollow


class Renderer:
    """A head on an OpenGL context (3.1 or newer).

    The head is posed at rest (all parameters 0) once, to find lids and lips.

    ctx : the moderngl context that is current.
    head : anything with the parts of `surface.view.scene.parts.ViewHead`.
    quality : "full" shades skin and mouth per pixel, "fast" per vertex.
    theme : name in `surface.view.scene.theme.THEMES`, or a :class:`Theme`.
    evaluator : what evaluates the vertices: "cpu", "gpu", or "auto" (see :func:`surface.view.draw.evaluator.choose`).

    Raises ValueError: unknown quality or evaluator. ViewError: unknown theme, the driver refuses a shader, or evaluator
    "gpu" cannot be used.
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
        self.theme = find_theme(theme)
        self._middle_z = framing_of(head, worn=False).point((0.0, 0.0, 0.0))[2]
        self._values = np.zeros(len(head.parameters))
        head.pose(self._values)
        self.evaluator = choose(ctx, head, evaluator)
        self.evaluator.pose(self._values)
        self.openings = Openings(head.parts, lambda part, ids: self.evaluator.positions(part, ids), head.contacts)
        self.openings.wrinkles = wrinkles_of(head) if self.theme.use_painted else None
        self._fine = ["freckles"] if any("freckles" in part.attributes for part in head.parts) else []
        self._fine += ["lips"] if self.openings.lip_tint else []
        self._fine += [materials.FOLD] if self.openings.folded else []
        self._texture = texture_of(ctx, head, self.theme)
        self._fine += [materials.TEXTURE] if self._texture is not None else []
        used = {materials.material_of(part.material).program for part in head.parts}
        self._worn = [name for name in materials.WORN if name in used]
        self._programs = materials.programs(
            ctx, quality, self.theme, fine=self._fine, worn=self._worn, wrinkles=self._wrinkles
        )
        self._accessories = self._accessory_buffers()
        self._detail = materials.detail_texture(ctx)
        self._background = Rectangles(ctx, self._programs["background"])
        parts = sorted(head.parts, key=lambda part: materials.material_of(part.material).order)
        # Taken from the part at rest: later the face may have moved.
        self._static = {p.name: materials.material_of(p.material).static(p, self.theme, self.openings) for p in parts}
        seen = [part for part in parts if len(part.triangles)]  # clothes may hide all of a part
        self._parts: list[PartBuffers] | list[DrawCall] = [self._buffers(part) for part in seen]
        self._simplified = False
        self._lined = any(part.material == "mouth" for part in head.parts)
        self._camera: tuple[Camera, float] | None = None
        self._into_bust = False
        #: Grows with every upload: equal revisions, cameras and themes draw equal pictures.
        self.revision = 0
        #: Whether another renderer draws the same head, too: then what the head says has changed is not all that has.
        self.resend = False
        self._apply_theme()

    @property
    def _wrinkles(self) -> int:
        """How many wrinkles darken their floors."""
        return 0 if self.openings.wrinkles is None else self.openings.wrinkles.count

    def _buffers(self, part: ViewPart) -> PartBuffers:
        """Buffers of `part` with the data that its material needs."""
        program = self._programs[materials.material_of(part.material).program]
        on_gpu = self.evaluator.name == "gpu"
        return PartBuffers(self.ctx, part, program, self._static[part.name], on_gpu=on_gpu)

    def _accessory_buffers(self, *, simplified: bool = False) -> AccessoryBuffers | None:
        """The head's accessories, ``simplified`` for live pictures drawn in software; none of a mask or a robot, which
        show the face alone."""
        meshes = getattr(self.head, "accessories", ())
        if not meshes or not self.theme.dressed:
            return None
        self._programs |= accessory_programs(self.ctx, "fast" if simplified else self.quality)
        return AccessoryBuffers(self.ctx, meshes, self._programs, simplified=simplified)

    def _release_accessories(self) -> None:
        if self._accessories is not None:
            self._accessories.release()
            for name in PROGRAMS:
                self._programs[name].release()

    def hurry(self) -> None:
        """Switch to decimated triangles and simpler shading, for live pictures drawn in software.

        Afterwards the head's own vertices keep their last values, as with evaluator "gpu".
        """
        if self._simplified or self.evaluator.name != "cpu":
            return
        if self._texture is not None:
            self._texture.simplify()
        self._simplified, old = True, [self._programs[name] for name in ("skin", *self._worn)]
        self._programs["skin"] = materials.skin_program(
            self.ctx, self.quality, self.theme, simplified=True, fine=self._fine, wrinkles=self._wrinkles
        )
        for name in self._worn:
            self._programs[name] = materials.worn_program(self.ctx, name, self.quality, simplified=True)
        for thing in (*self._parts, *old):
            thing.release()
        self._release_accessories()
        self._accessories = self._accessory_buffers(simplified=True)
        self._parts = self._decimated_parts() or [self._buffers(buffers.part) for buffers in self._parts]
        self._camera = None
        self._apply_theme()

    def _decimated_parts(self) -> list[DrawCall]:
        """The head's decimated triangles with an evaluator of their own; none if it has none."""
        if not any(getattr(part, "decimated", None) for part in self.head.parts):
            return []
        from surface.view.draw.decimated_draw import DecimatedEvaluator, draw_calls  # compiled: loaded when first used

        evaluator = DecimatedEvaluator(self.head, self.quality, self.openings, self.evaluator.reason)  # type: ignore[arg-type]
        evaluator.pose(self._values)
        self.evaluator = evaluator
        return draw_calls(self.ctx, evaluator.decimated, self._programs, lambda part: self._static[part.name])

    def pose(self, values: np.ndarray) -> None:
        """Move the head to parameter values (P,)."""
        self.evaluator.pose(values)
        self.take(values)

    def take(self, values: np.ndarray) -> None:
        """Take the parameter values (P,) by which somebody else has posed the head."""
        self._values = np.array(values, float)

    def update(self) -> int:
        """Bring the buffers up to date with the last :meth:`pose`, once after each. Returns vertices changed."""
        self.openings.refresh()
        if self.openings.wrinkles is not None:
            self.openings.wrinkles.show(self._values)
        pupil = float(getattr(self.head, "pupil", 0.0))
        if pupil != self.openings.pupil:
            self.openings.pupil = pupil
            self.revision += 1
        if self.resend and type(self.evaluator) is Evaluator:
            whole = [buffers for buffers in self._parts if isinstance(buffers, PartBuffers)]
            sent = sum(buffers.upload([(0, len(buffers.part.vertices))]) for buffers in whole)
        else:
            sent = self.evaluator.update(self._parts)
        self.revision += sent > 0
        return sent

    def draw(self, camera: Camera, target: moderngl.Framebuffer, bands: Bands | None = None) -> None:
        """Draw the head into `target`, and the background around it: everywhere, or only within `bands`, which contain
        the head."""
        width, height = target.size
        target.scissor = 0, 0, width, height
        target.use()
        # Colours stay: what was drawn before and is not covered now is background.
        target.depth_mask, target.color_mask = True, (False, False, False, False)
        target.clear(depth=1.0)
        target.color_mask = True, True, True, True
        target.use()  # again: it applies the masks
        self.ctx.viewport = (0, 0, width, height)
        self.ctx.depth_func = "<="
        factors = self.ctx.SRC_ALPHA, self.ctx.ONE_MINUS_SRC_ALPHA, self.ctx.ONE, self.ctx.ONE_MINUS_SRC_ALPHA
        self.ctx.blend_func = factors  # type: ignore[assignment]  # its types know two; alpha stays what it was
        self._aim(camera, width / max(height, 1))
        self._detail.use(0)
        if self._texture is not None:
            self._texture.texture.use(TEXTURE_UNIT)
        if self._accessories is not None:
            self._accessories.turn(self.evaluator.rotation())
            self._accessories.draw_solid(multisampled=target.samples > 1)
        hidden = materials.BEHIND_LIPS if self._lips_hide() else ()
        for buffers in self._parts:
            if buffers.part.material not in hidden:
                self._draw_part(buffers, multisampled=target.samples > 1)
        self.ctx.enable_only(self.ctx.DEPTH_TEST)
        theme = self.theme
        set_uniforms(self._programs["background"], {"top": theme.background_top, "bottom": theme.background_bottom})
        self._background.render(corners((bands or Bands.whole(target.size)).boxes(), target.size))
        if self._accessories is not None:
            self._accessories.draw_blended(target)

    def _lips_hide(self) -> bool:
        """Whether nothing of :data:`materials.BEHIND_LIPS` is seen from the present camera. From below, the bust is
        open; a display in place of the mouth is a line of light where lips touch."""
        return self.evaluator.lips_closed and self._lined and not self._into_bust and not self.theme.lit

    def region(self, camera: Camera, size: tuple[int, int]) -> Bands:
        """The pixels of a picture of `size` that the head, as posed now, can cover."""
        found = Silhouette(size, camera.matrix(size[0] / size[1]), camera.near)
        outer = [p for p in self._parts if p.part.material not in materials.INSIDE] or self._parts
        worn: list[tuple[np.ndarray, np.ndarray]] = []
        if self._accessories is not None:
            self._accessories.turn(self.evaluator.rotation())
            worn = self._accessories.outlines()
        for outline in (*(buffers.outline() for buffers in outer), *worn):
            if outline is None or not found.add(*outline):
                return Bands.whole(size)
        return found.bands()

    def set_background(self, top: Colour, bottom: Colour) -> None:
        """Change the gradient; sRGB colours 0..1."""
        self.theme = replace(self.theme, background_top=top, background_bottom=bottom)

    def _draw_part(self, buffers: PartBuffers | DrawCall, *, multisampled: bool) -> None:
        """One part with its material's uniforms and culling."""
        material = materials.material_of(buffers.part.material)
        if material.covering:
            set_uniforms(self._programs[material.program], {"multisampled": int(multisampled)})
        set_uniforms(self._programs[material.program], material.uniforms(buffers.part, self.theme, self.openings))
        hollow = self._into_bust and material.program == "skin"
        flags = self.ctx.DEPTH_TEST
        flags |= 0 if material.two_sided or hollow else self.ctx.CULL_FACE
        flags |= self.ctx.BLEND if material.blended else 0
        self.ctx.enable_only(flags)
        if not (material.covering and multisampled):
            buffers.draw()
            return
        self.ctx.enable_direct(_ALPHA_TO_COVERAGE)
        buffers.draw()
        self.ctx.disable_direct(_ALPHA_TO_COVERAGE)

    def _apply_theme(self) -> None:
        """Set the uniforms that do not change with camera or pose."""
        theme = self.theme
        lights = {f"{name}_colour": getattr(theme, name).colour for name in ("key", "fill", "rim")}
        for program in self._programs.values():
            set_uniforms(program, {**lights, "sky": theme.sky, "ground": theme.ground, "detail": 0})
        if self._texture is not None:
            for name in ("skin", "eye"):
                self._texture.set_uniforms(self._programs[name])

    def _aim(self, camera: Camera, aspect: float) -> None:
        """Set the uniforms of camera and lights, most of them only when the camera or the aspect ratio changed."""
        turn = self.theme.lights_follow * camera.yaw_deg
        lights = {name: light_direction(getattr(self.theme, name), turn) for name in ("key", "fill", "rim")}
        back = self.evaluator.rotation().T  # the lights as the head at rest would see them, for baked shade
        set_uniforms(self._programs["skin"], {f"{name}_at_rest": back @ lights[name] for name in ("key", "rim")})
        if "strand" in self._programs:
            set_uniforms(self._programs["strand"], {"head_rotation": back.T})
        if self._camera == (camera, aspect):
            return
        self._camera = (camera, aspect)
        self._into_bust = camera.eye[2] < self._middle_z or camera.pitch_deg < _LOW_DEG
        shared = {f"{name}_direction": direction for name, direction in lights.items()}
        for program in self._programs.values():
            set_uniforms(program, {**shared, "view_projection": camera.matrix(aspect), "camera": camera.eye})

    def release(self) -> None:
        """Release every buffer and program."""
        for thing in (*self._parts, self.evaluator, self._background, self._detail, *self._programs.values()):
            thing.release()
        if self._accessories is not None:
            self._accessories.release()
        if self._texture is not None:
            self._texture.texture.release()


class Rectangles:
    """Rectangles of a picture, to run a fragment shader over.

    program : with an input `corner`, as in background.vert.
    """

    def __init__(self, ctx: moderngl.Context, program: moderngl.Program) -> None:
        self._ctx, self._program = ctx, program
        self._allocate(1024)

    def _allocate(self, size: int) -> None:
        self._corners = self._ctx.buffer(reserve=size, dynamic=True)
        self._array = self._ctx.vertex_array(self._program, [(self._corners, "2f", "corner")])
        self._ctx.clear_errors()  # moderngl sets a divisor, which OpenGL 3.1 does not have

    def render(self, vertices: np.ndarray) -> None:
        """Draw triangles with these `vertices` (k, 2) float32 in clip space."""
        if vertices.nbytes > self._corners.size:
            self.release()
            self._allocate(vertices.nbytes)
        self._corners.orphan()
        self._corners.write(vertices.tobytes())
        self._array.render(vertices=len(vertices))

    def release(self) -> None:
        """Release the buffer."""
        self._array.release()
        self._corners.release()


def light_direction(light: Light, turn_deg: float) -> np.ndarray:
    """Unit vector (3,) towards `light`, rotated about y by `turn_deg`."""
    yaw, pitch = np.radians(light.yaw_deg + turn_deg), np.radians(light.pitch_deg)
    return np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)], np.float32)
