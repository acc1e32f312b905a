"""Materials: which shader program draws a part, with which vertex data and uniforms."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from surface.base.arrays import median
from surface.mesh.strips import lower_strips, strip_uv
from surface.view.draw.programs import build
from surface.view.draw.rims import rim_shade
from surface.view.draw.tooth_necks import tooth_necks
from surface.view.scene.openings import LID_POINTS, Openings
from surface.view.scene.parts import ViewPart
from surface.view.scene.theme import Theme

if TYPE_CHECKING:
    import moderngl

Arrays = dict[str, np.ndarray]
#: Tiles of the detail texture around the head; a whole number, so that its seam at the back of the head is invisible.
_DETAIL_TILES = 18
#: Pores: how many along a side of the detail texture, their radius in texels, how steep and how dark they are beside
#: its noise, and how much of the noise's bumps is left beside them.
_PORES, _PORE_RADIUS, _PORE_SLOPE, _PORE_DARK, _GRAIN = 26, 1.1, 1.2, 0.8, 0.7
#: Where in its square a pore may lie: two that meet would look like one large pit.
_PORE_ROOM = 0.2, 0.8
#: Centre of the sphere that the detail is wrapped on, mm.
_DETAIL_CENTRE = (0.0, 10.0, 5.0)
_DETAIL_RADIUS, _DETAIL_BLEND = 95.0, 90.0
_DETAIL_SIZE = 128
#: Length of a tile of the detail texture on skin.
DETAIL_TILE_MM = 2.0 * np.pi * _DETAIL_RADIUS / _DETAIL_TILES
#: Brightness of the back of skin, as the hollow bust shows it from below and behind.
_INSIDE = "0.25"
#: A baked sky without occlusion.
_OPEN_SKY = (0.75, 0.5, 0.5, 0.5)
_LOWER_LASHES = 0.42
#: Half the width of a tongue's furrow, mm, and how much of the light it takes.
_GROOVE_MM, _GROOVE = 2.2, 0.5
#: Radius of an iris, in eyeball radii, and of its pupil, in radii of the iris.
_IRIS, _PUPIL = 0.49, 0.185 / 0.49
#: In radii of the iris: a rim of it is always left.
_WIDEST_PUPIL = 0.75
#: How a bar of lamps fades, as brows do in hair.frag.
_BAR = (2.2, -2.6, 0.08, 0.0)
#: How far from its roots hair counts that does not hang from a parting, mm.
_NO_ROOTS_MM = 1e3
#: Materials of parts that the skin surrounds in every pose.
INSIDE = ("eye", "teeth", "gums", "mouth")
#: Of these, those that closed lips hide: a tongue may reach out between them, and the mouth's lining is seen where a
#: pixel between two lips shows neither.
BEHIND_LIPS = ("teeth", "gums")
#: Programs of what is worn.
WORN = ("strand", "cloth")
#: Attributes of skin that are drawn by pixel, with quality "full": freckles, and the edge of the lips.
FINE = ("freckles", "lips")
#: Of skin with folds over the eyes, in both qualities.
FOLD = "fold"
#: Of skin with wrinkles whose floors are darker, in both qualities.
FURROW = "furrow"
#: What a head's skin has whose mesh brought a texture, drawn by pixel in every quality.
TEXTURE = "texture"


@dataclass(frozen=True)
class Material:
    """How one kind of part is drawn.

    program : name in :func:`programs`.
    static : per-vertex data that never changes.
    uniforms : uniforms of this frame.
    two_sided : whether back faces are drawn.
    blended : whether the fragment's alpha blends it with the picture behind.
    covering : whether the fragment's alpha decides how many of a pixel's samples it covers.
    order : lower is drawn earlier; what hides most comes first.
    """

    program: str
    static: Callable[[ViewPart, Theme, Openings], Arrays]
    uniforms: Callable[[ViewPart, Theme, Openings], Mapping[str, Any]]
    two_sided: bool = False
    blended: bool = False
    covering: bool = False
    order: int = 0


def programs(
    ctx: moderngl.Context, quality: str, theme: Theme, *, fine: Collection[str] = (), worn: Collection[str] = (),
    wrinkles: int = 0,
) -> dict[str, moderngl.Program]:  # fmt: skip
    """Every program of a quality and a theme, by name; ``fine`` and ``wrinkles`` as in :func:`skin_program`, ``worn`` :
    which of those for what is worn."""
    flat = ("flat.frag",)
    eye: dict[str, int | str] = {"LID_POINTS": LID_POINTS}
    if TEXTURE in fine and theme.use_painted:
        eye["TEXTURE"] = 1
    return {name: worn_program(ctx, name, quality) for name in WORN if name in worn} | {
        "skin": skin_program(ctx, quality, theme, fine=fine, wrinkles=wrinkles),
        "eye": build(ctx, ("eye.vert",), ("light.glsl", "eye.frag"), defines=eye),
        "inner": build(
            ctx,
            *(
                (("display.vert",), ("light.glsl", "display.frag"))
                if theme.lit
                else (("light.glsl", "inner.vert"), flat)
            ),
        ),
        "hair": build(ctx, ("light.glsl", "hair.vert"), ("hair.frag",)),
        "background": build(ctx, ("background.vert",), ("background.frag",)),
    }


def skin_program(
    ctx: moderngl.Context, quality: str, theme: Theme, *, simplified: bool = False, fine: Collection[str] = (),
    wrinkles: int = 0,
) -> moderngl.Program:  # fmt: skip
    """The program of skin; `simplified` samples its grain unfiltered, for live pictures drawn in software; `fine` :
    attributes of parts that quality "full" draws by pixel, of :data:`FINE`; :data:`FOLD`; and :data:`TEXTURE`;
    `wrinkles` : how many darken their floors."""
    defines: dict[str, int | str] = {"INSIDE": _INSIDE}
    scale: dict[str, int | str] = {"DETAIL_PER_RADIAN": f"{_DETAIL_TILES / (2.0 * np.pi):.5f}"}
    textured = TEXTURE in fine and theme.use_painted
    if textured:
        defines["TEXTURE"] = 1
    if FOLD in fine and theme.use_painted and not textured:
        defines["FOLD"] = 1
    if wrinkles and theme.use_painted:
        defines["WRINKLES"] = wrinkles
    if theme.lit:
        defines |= {"PANELS": 1} | scale
    if quality != "full":
        fragment = ("light.glsl", "panels.glsl", "panels_fast.frag") if theme.lit else ("flat.frag",)
        if textured:
            fragment = ("light.glsl", "texture.glsl", "textured_fast.frag")
        return build(ctx, ("light.glsl", "skin.glsl", "skin_fast.vert"), fragment, defines=defines)
    if theme.seams:
        defines |= {"SEAMS": 1} | scale
    if theme.use_painted:
        defines |= {name.upper(): 1 for name in FINE if name in fine}
    if simplified:
        defines["GRAIN_TEXELS"] = f"{_DETAIL_SIZE // 2}.0"
    shared = ("light.glsl", "skin.glsl")
    more = (*(("panels.glsl",) if theme.lit else ()), *(("texture.glsl",) if textured else ()))
    return build(ctx, (*shared, "skin.vert"), (*shared, *more, "skin.frag"), defines=defines)


def worn_program(ctx: moderngl.Context, name: str, quality: str, *, simplified: bool = False) -> moderngl.Program:
    """The program of "strand" or "cloth"; ``simplified`` as in :func:`skin_program`, with highlights per vertex as
    with quality "fast"."""
    defines: dict[str, int | str] = {"GRAIN_TEXELS": f"{_DETAIL_SIZE // 2}.0"} if simplified else {}
    if quality != "full" or simplified:
        defines["PER_VERTEX"] = 1
    shared = ("light.glsl", *(("strand.glsl",) if name == "strand" else ()))
    return build(ctx, (*shared, f"{name}.vert"), (*shared, f"{name}.frag"), defines=defines)


def material_of(name: str) -> Material:
    """The material of that name; an unknown one draws as skin."""
    return MATERIALS.get(name, MATERIALS["skin"])


def uniforms_key(part: ViewPart) -> tuple[str, str]:
    """Equal for parts with the same uniforms in every frame: those of a material, but each eye has its own."""
    return part.material, part.name if part.material == "eye" else ""


def attribute(part: ViewPart, name: str, default: tuple[float, ...]) -> np.ndarray:
    """A part's static attribute (m, k) float32, or `default` for every vertex."""
    data = part.attributes.get(name)
    if data is None:
        return np.tile(np.asarray(default, np.float32), (len(part.vertices), 1))
    return np.asarray(data, np.float32).reshape(len(part.vertices), -1)


def _skin_static(part: ViewPart, theme: Theme, openings: Openings) -> Arrays:
    albedo = attribute(part, "albedo", theme.albedo)[:, :3]
    if not theme.use_painted:
        albedo = np.tile(np.asarray(theme.albedo, np.float32), (len(albedo), 1))
    gloss = attribute(part, "gloss", (0.3,))[:, :1]
    if not theme.use_painted:  # what is wet on a face is darker on a mask
        albedo = albedo * (1.0 - theme.lips * np.clip((gloss - 0.30) / 0.3, 0.0, 1.0))
    occlusion = attribute(part, "occlusion", (1.0,))[:, :1]
    packed = np.hstack([np.sqrt(np.clip(albedo, 0.0, 1.0)), np.clip(occlusion, 0.0, 1.0)])
    thin = attribute(part, "thin", (0.0,))[:, :1]
    fine = {}
    if theme.use_painted and openings.lip_tint:
        fine["lips"] = attribute(part, "lips", (0.0,))  # of every part: they are drawn together
    if theme.use_painted and "texture_uv" in part.attributes:
        fine["texture_uv"] = part.attributes["texture_uv"]
    if theme.use_painted and openings.folded:
        fine[FOLD] = openings.fold_at(part)
    if theme.use_painted and openings.wrinkles is not None:
        fine[FURROW] = openings.wrinkles.at(part)
    if "freckles" in part.attributes:
        fine["freckles"] = part.attributes["freckles"]
    lamp = {"lamp": openings.lip_line(part).astype(np.float32)[:, None]} if theme.lit else {}
    return (
        fine
        | lamp
        | {
            "albedo_occlusion": np.rint(packed * 255.0).astype(np.uint8),
            "around": np.rint(attribute(part, "visible", _OPEN_SKY)[:, :4] * 255.0).astype(np.uint8),
            "surface_uv_gloss": np.hstack([detail_uv(part, theme), gloss, thin]).astype(np.float32),
        }
    )


def detail_uv(part: ViewPart, theme: Theme) -> np.ndarray:
    """Texture coordinates (m, 2) of the detail texture on a part, in tiles: as laid out for the head, where it was.

    Plates and panels lie along longitude and latitude of the skull.
    """
    laid = part.attributes.get("grain")
    return wrapped_uv(part) if laid is None or theme.seams or theme.lit else np.asarray(laid)


def wrapped_uv(part: ViewPart) -> np.ndarray:
    """Longitude and latitude of a part at rest on the skull, height and reach on neck and shoulders, (m, 2) in tiles: a
    head's own (u, v) are stretched, and differ from part to part.
    """
    x, y, z = (np.asarray(part.vertices, np.float64) - _DETAIL_CENTRE).T
    reach = np.hypot(x, z)
    below = np.clip(-y / _DETAIL_BLEND, 0.0, 1.0)
    down = (y - 0.7 * (reach - _DETAIL_RADIUS)) / _DETAIL_RADIUS
    height = np.arctan2(y, reach) * (1.0 - below) + down * below
    return np.column_stack([np.arctan2(x, z), height]) * (_DETAIL_TILES / (2.0 * np.pi))


def _skin_uniforms(part: ViewPart, theme: Theme, openings: Openings) -> Mapping[str, Any]:
    return {
        "wrap": theme.wrap,
        "through": theme.through,
        "gloss_scale": theme.gloss,
        "detail_strength": 0.16 * theme.detail,
        **({"lip_tint": openings.lip_tint} if theme.use_painted and openings.lip_tint else {}),
        **({"fold_left": openings.fold_left()} if theme.use_painted and openings.folded else {}),
        **({"wrinkle_depths": openings.wrinkles.depths} if theme.use_painted and openings.wrinkles is not None else {}),
        **_lamps(theme),
    }


def _lamps(theme: Theme) -> dict[str, Any]:
    return {"lamps": theme.lamps} if theme.lit else {}


def _eye_uniforms(part: ViewPart, theme: Theme, openings: Openings) -> Mapping[str, Any]:
    painted = openings.painted(part)
    colours = painted if theme.use_painted else {}
    radius = float(painted.get("iris_radius", (_IRIS,))[0])
    return {
        "iris_colour": tuple(colours.get("iris", theme.iris)),
        "sclera_colour": tuple(colours.get("sclera", theme.sclera)),
        "glow": theme.glow,
        "iris_radius": radius,
        "pupil_radius": min(_PUPIL * theme.pupil * (1.0 + openings.pupil), _WIDEST_PUPIL) * radius,
        **openings.eye(part),
        **_rectangle(colours),
    }


def _rectangle(colours: Mapping[str, Any]) -> dict[str, Any]:
    """Where an eye is in its head's texture, of heads that have one."""
    own = colours.get("texture_rectangle")
    return {} if own is None else {"texture_rectangle": tuple(map(float, own))}


def _inner(
    albedo: tuple[float, float, float], wrap: float, wetness: float,
    shade: Callable[[ViewPart], np.ndarray] | None = None, **options: Any,
) -> Material:  # fmt: skip
    """A material inside the mouth; ``shade`` gives (m, 2): occlusion, and how much gum covers a tooth."""

    two_sided = float(options.get("two_sided", False))
    fixed = {"albedo": albedo, "wrap": (wrap, 0.6 * wrap, 0.6 * wrap), "wetness": wetness, "two_sided": two_sided}
    return Material(
        "inner",
        lambda part, theme, openings: {"shade": (shade or _bare)(part)},
        lambda part, theme, openings: fixed | _lamps(theme) | openings.mouth(),
        **options,
    )


def _occlusion(part: ViewPart) -> np.ndarray:
    return attribute(part, "occlusion", (1.0,))[:, :1]


def _bare(part: ViewPart) -> np.ndarray:
    """(m, 2): occlusion, and no gum."""
    return np.hstack([_occlusion(part), np.zeros((len(part.vertices), 1), np.float32)])


def _necked(part: ViewPart) -> np.ndarray:
    """(m, 2): occlusion, and the gum that covers teeth."""
    necks = tooth_necks(np.asarray(part.vertices, np.float64), part.triangles)
    return np.hstack([_occlusion(part), necks[:, None]])


def _lined(part: ViewPart) -> np.ndarray:
    """(m, 2): occlusion of what lines a mouth, which lies in the lips' shade at its rim, and no gum."""
    shade = _bare(part)
    shade[:, 0] *= rim_shade(np.asarray(part.vertices, np.float64), part.triangles)
    return shade


def _grooved(part: ViewPart) -> np.ndarray:
    """(m, 2): occlusion of a tongue, with a furrow along the middle of its upper side, and no gum."""
    across = np.asarray(part.vertices[:, 0]) - median(part.vertices[:, 0])
    furrow = np.exp(-((across / _GROOVE_MM) ** 2)) * np.clip(part.normals[:, 1], 0.0, 1.0)
    shade = _bare(part)
    shade[:, 0] *= 1.0 - _GROOVE * furrow
    return shade


def _hair(colour: str, fade: tuple[float, float, float, float], edges: float = 0.0) -> Material:
    """Lashes or brows; `colour` is a key of the theme, `fade` and `edges` are as in hair.frag."""
    return Material(
        "hair",
        lambda part, theme, openings: {"along": np.hstack([strip_uv(part), strip_strength(part, theme)])},
        lambda part, theme, openings: _hair_uniforms(part, theme, colour, fade, edges),
        two_sided=True,
        blended=True,
        order=2,
    )


def _hair_uniforms(
    part: ViewPart, theme: Theme, colour: str, fade: tuple[float, float, float, float], edges: float
) -> Mapping[str, Any]:
    if theme.lit and colour == "brow":  # a bar of lamps
        return {"albedo": theme.brow, "lamps": theme.lamps, "fade": _BAR, "edges": 0.0}
    return {"albedo": _painted(part, theme, colour), "lamps": (0.0, 0.0, 0.0), "fade": fade, "edges": edges}


def _painted(part: ViewPart, theme: Theme, colour: str) -> tuple[float, ...]:
    """A part's own colour, one for all of it, or the theme's of that name."""
    own = part.attributes.get("albedo")
    return getattr(theme, colour) if own is None or not theme.use_painted else tuple(own[0].tolist())


def strip_strength(part: ViewPart, theme: Theme) -> np.ndarray:
    """Opacity of each hair, (m, 1): lashes of the lower lid are fainter."""
    share = 1.0 if theme.lit and part.material == "brow" else theme.hair
    strength = share * (attribute(part, "strength", (1.0,))[:, :1] if theme.use_painted else np.ones((len(part.uv), 1)))
    strength = strength.astype(np.float32)
    if part.material == "lash":
        strength[lower_strips(part)] *= _LOWER_LASHES
    return strength


def _worn_static(part: ViewPart, theme: Theme, openings: Openings) -> Arrays:
    albedo, gloss = attribute(part, "albedo", theme.albedo)[:, :3], attribute(part, "gloss", (1.0,))[:, :1]
    packed = np.clip(np.hstack([np.sqrt(np.clip(albedo, 0.0, 1.0)), gloss]), 0.0, 1.0)
    static = {
        "albedo_gloss": np.rint(packed * 255.0).astype(np.uint8),
        "strands": attribute(part, "strands", (0.0, 0.0, 1.0, 1.0)),
    }
    if material_of(part.material).program == "strand":
        static["along"] = attribute(part, "along", (0.0, -1.0, 0.0))
        static["roots"] = attribute(part, "roots", (_NO_ROOTS_MM,))[:, :1]
    return static


def _worn(program: str, order: int, *, two_sided: bool = False) -> Material:
    """Hair or cloth, drawn before the skin, which it hides; of hair all over the skull only the near side is drawn."""
    covering = program == "strand"
    return Material(program, _worn_static, _worn_uniforms, two_sided=two_sided, covering=covering, order=order)


def _worn_uniforms(part: ViewPart, theme: Theme, openings: Openings) -> dict[str, Any]:
    """How much brighter than hair the skin at a parting is."""
    scalp = part.attributes.get("scalp")
    return {"scalp": (1.0, 1.0, 1.0) if scalp is None else tuple(map(float, scalp[0]))}


MATERIALS: dict[str, Material] = {
    "strand": _worn("strand", -3),
    "tress": _worn("strand", 1, two_sided=True),
    "cloth": _worn("cloth", -1, two_sided=True),
    "skin": Material("skin", _skin_static, _skin_uniforms, order=0),
    "eye": Material("eye", lambda part, theme, openings: {"local": openings.local(part)}, _eye_uniforms, order=1),
    "lash": _hair("lash", (0.85, 0.15, 0.0, 0.0)),
    "brow": _hair("brow", (0.52, 0.36, 0.34, 0.92), 1.0),
    "teeth": _inner((0.76, 0.71, 0.62), 0.3, 0.30, _necked, order=3),
    "tongue": _inner((0.53, 0.20, 0.18), 0.4, 0.42, _grooved, order=4),
    "gums": _inner((0.57, 0.25, 0.23), 0.3, 0.20, order=5),
    "mouth": _inner((0.46, 0.16, 0.15), 0.3, 0.20, _lined, two_sided=True, order=6),
}


def detail_texture(ctx: moderngl.Context) -> moderngl.Texture:
    """Tiling noise (rgb: bumps, a: mottling) and pores from a fixed seed."""
    random = np.random.default_rng(7)
    layers = [_tiling_noise(random, falloff) for falloff in (0.5, 0.5, 0.5, 1.0)]
    bumps = np.stack(layers, axis=-1) * (_GRAIN, _GRAIN, 1.0, 1.0) + _pores(np.random.default_rng(8))
    data = np.clip(bumps / bumps.std(axis=(0, 1)) * 0.17 + 0.5, 0.0, 1.0)
    texture = ctx.texture((_DETAIL_SIZE, _DETAIL_SIZE), 4, np.rint(data * 255.0).astype(np.uint8).tobytes())
    texture.build_mipmaps()
    texture.filter = (ctx.LINEAR_MIPMAP_NEAREST, ctx.LINEAR)
    return texture


def _pores(random: np.random.Generator) -> np.ndarray:
    """Pits (size, size, 4) that tile: how the skin leans to the right and upwards in them, and how much darker they
    are; mipmaps level them where they are smaller than a pixel."""
    at, count = np.zeros((_DETAIL_SIZE, _DETAIL_SIZE)), _PORES**2
    places = np.indices((_PORES, _PORES)).reshape(2, -1) + random.uniform(*_PORE_ROOM, (2, count))
    at[tuple((places * _DETAIL_SIZE / _PORES).astype(int))] = random.uniform(0.3, 1.0, count)
    frequency = 2.0 * np.pi * np.fft.fftfreq(_DETAIL_SIZE)
    up, right = frequency[:, None], frequency[None, :]
    square = up**2 + right**2
    pits = np.fft.fft2(at) * np.exp(-0.5 * _PORE_RADIUS**2 * square) * (square > (4.0 * np.pi / _DETAIL_SIZE) ** 2)
    leaning = [np.fft.ifft2(1j * way * pits).real for way in (right, up)]
    dark = -np.fft.ifft2(pits).real
    slope, depth = _PORE_SLOPE / np.std(leaning), _PORE_DARK / dark.std()
    return np.stack([slope * leaning[0], slope * leaning[1], 0.0 * dark, depth * dark], axis=-1)


def _tiling_noise(random: np.random.Generator, falloff: float) -> np.ndarray:
    """Noise (size, size) that tiles, zero mean, unit deviation; amplitude falls as frequency**-falloff."""
    frequency = np.fft.fftfreq(_DETAIL_SIZE) * _DETAIL_SIZE
    radius = np.hypot(frequency[:, None], frequency[None, :])
    shape = np.where(radius > 2.0, np.maximum(radius, 1.0) ** -falloff, 0.0)
    noise = np.fft.ifft2(np.fft.fft2(random.standard_normal((_DETAIL_SIZE, _DETAIL_SIZE))) * shape).real
    even: np.ndarray = (noise - noise.mean()) / noise.std()
    return even
