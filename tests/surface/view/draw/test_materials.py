"""surface.view.draw.materials"""

from __future__ import annotations

import numpy as np
import pytest
from ball_head import BallHead, BallPart, skin

from surface.view.draw.materials import (
    MATERIALS,
    _pores,
    attribute,
    detail_texture,
    detail_uv,
    material_of,
    programs,
    skin_program,
    uniforms_key,
)
from surface.view.pictures.offscreen import open_context
from surface.view.scene.openings import Openings
from surface.view.scene.theme import THEMES


def test_skin_is_drawn_before_what_it_hides() -> None:
    assert (
        material_of("skin").order < material_of("eye").order < material_of("teeth").order < material_of("mouth").order
    )


def test_an_unknown_material_draws_as_skin() -> None:
    assert material_of("velvet") is MATERIALS["skin"]


def test_painted_albedo_and_occlusion_are_packed() -> None:
    part = skin()
    count = len(part.rest)
    part.attributes = {"albedo": np.full((count, 3), 0.25, np.float32), "occlusion": np.full((count, 1), 0.5)}
    packed = material_of("skin").static(part, THEMES["skin"], Openings([part]))["albedo_occlusion"]
    assert packed.dtype == np.uint8
    assert packed[0] / 255.0 == pytest.approx([0.5, 0.5, 0.5, 0.5], abs=0.003)
    bare = material_of("skin").static(part, THEMES["mask"], Openings([part]))["albedo_occlusion"]
    assert (bare[0, :3] / 255.0) ** 2 == pytest.approx(THEMES["mask"].albedo, abs=0.006)


def test_missing_attributes_have_defaults() -> None:
    part = skin()
    assert attribute(part, "gloss", (0.3,)) == pytest.approx(np.full((len(part.rest), 1), 0.3))
    assert (material_of("skin").static(part, THEMES["skin"], Openings([part]))["albedo_occlusion"][:, 3] == 255).all()


def test_detail_is_even_in_millimetres_and_closes_behind_the_head() -> None:
    part = skin()
    uv = detail_uv(part, THEMES["skin"])
    front = np.argmin(np.linalg.norm(part.rest - [0, 10, 90], axis=1))
    near = np.flatnonzero(np.linalg.norm(part.rest - part.rest[front], axis=1) < 12)
    moved = np.linalg.norm(part.rest[near] - part.rest[front], axis=1)
    scale = np.linalg.norm(uv[near] - uv[front], axis=1)[moved > 3] / moved[moved > 3]
    assert scale.max() / scale.min() < 1.3
    back = uv[part.rest[:, 2] < -0.9 * part.rest[:, 2].max()]
    assert np.ptp(back[:, 0]) == pytest.approx(round(np.ptp(back[:, 0])), abs=1e-6)


def openings() -> Openings:
    return Openings(BallHead().parts)


@pytest.mark.parametrize("theme", THEMES)
def test_skin_of_a_mask_is_plain_and_darker_on_wet_lips(theme: str) -> None:
    part, own = skin(), THEMES[theme]
    count = len(part.rest)
    gloss = np.full((count, 1), 0.3, np.float32)
    gloss[0], gloss[1] = 0.6, 0.45
    part.attributes = {"albedo": np.full((count, 3), 0.25, np.float32), "gloss": gloss}
    colour = (material_of("skin").static(part, own, Openings([part]))["albedo_occlusion"][:, :3] / 255.0) ** 2
    if theme == "skin":
        assert colour == pytest.approx(np.full((count, 3), 0.25), abs=0.006)
    else:
        for row, share in ((0, 1.0), (1, 0.5), (2, 0.0)):
            assert colour[row] == pytest.approx(np.array(own.albedo) * (1 - own.lips * share), abs=0.006)


def test_vertex_data_of_skin_comes_in_the_order_of_the_shader() -> None:
    part = skin()
    count = len(part.rest)
    sky = np.tile([0.0, 0.2, 0.4, 1.0], (count, 1))
    part.attributes = {"visible": sky, "thin": np.full((count, 1), 0.7), "gloss": np.full((count, 1), 0.4)}
    made = material_of("skin").static(part, THEMES["skin"], Openings([part]))
    assert made["around"].dtype == np.uint8 and made["around"][0].tolist() == [0, 51, 102, 255]
    assert made["surface_uv_gloss"][:, 2:] == pytest.approx(np.tile([0.4, 0.7], (count, 1)))
    assert made["surface_uv_gloss"][:, :2] == pytest.approx(detail_uv(part, THEMES["skin"]), abs=1e-5)
    bare = material_of("skin").static(skin(), THEMES["skin"], Openings([part]))
    assert np.unique(bare["around"], axis=0).tolist() == [[191, 128, 128, 128]]
    assert bare["surface_uv_gloss"][:, 2:] == pytest.approx(np.tile([0.3, 0.0], (count, 1)))


def test_what_is_worn_shines_as_its_material_does_where_no_gloss_is_painted() -> None:
    bare, dull = skin(), skin()
    dull.attributes = {"gloss": np.full((len(dull.rest), 1), 0.2)}
    made = [material_of("cloth").static(part, THEMES["skin"], openings())["albedo_gloss"] for part in (bare, dull)]
    assert (made[0][:, 3] == 255).all() and (made[1][:, 3] == 51).all()


def test_detail_is_longitude_and_latitude_on_the_skull_and_height_below_it() -> None:
    part = skin()
    tiles = 18 / (2 * np.pi)
    part.vertices[:4] = [(0, 10, 100), (95, 10, 5), (0, 105, 5.001), (0, -200, 105)]
    uv = detail_uv(part, THEMES["skin"])[:4]
    assert uv[:2] == pytest.approx(np.array([[0, 0], [0.5 * np.pi, 0]]) * tiles, abs=1e-5)
    assert uv[2, 1] == pytest.approx(0.5 * np.pi * tiles, abs=1e-3)
    assert uv[3, 1] == pytest.approx((-210 - 0.7 * (100 - 95)) / 95 * tiles, abs=1e-4)


def test_lashes_of_the_lower_lid_are_fainter() -> None:
    at = np.array([[0, 5, 0], [1, 5, 0], [0, -5, 0]])
    part = BallPart("lashes", "lash", np.array([[0, 1, 2]]), at, np.zeros((3, 3)))
    part.uv[:] = [(0.5, 0.25), (0.75, 1.0), (2.5, 0.5)]
    along = material_of("lash").static(part, THEMES["skin"], openings())["along"]
    assert along == pytest.approx(np.array([[0.5, 0.25, 1], [0.75, 1, 1], [0.5, 0.5, 0.42]]))
    part.material = "brow"
    assert (material_of("brow").static(part, THEMES["skin"], openings())["along"][:, 2] == 1.0).all()
    assert (material_of("brow").static(part, THEMES["mask"], openings())["along"][:, 2] == 0.0).all()
    assert (material_of("brow").static(part, THEMES["robot"], openings())["along"][:, 2] == 1.0).all(), "bars of lamps"


def test_uniforms_name_what_the_shaders_read(gl: None) -> None:
    head = BallHead()
    seen = Openings(head.parts)
    ctx = open_context()
    try:
        made = programs(ctx, "full", THEMES["skin"])
        for part in head.parts:
            material = material_of(part.material)
            given = material.uniforms(part, THEMES["skin"], seen)
            assert [name for name in given if name not in made[material.program]] == []
            static = material.static(part, THEMES["skin"], seen)
            assert [name for name in static if name not in made[material.program]] == []
            assert all(len(rows) == len(part.vertices) for rows in static.values())
    finally:
        ctx.release()


def test_uniforms_follow_the_theme_and_the_openings() -> None:
    head, theme = BallHead(), THEMES["mask"]
    seen = Openings(head.parts)
    by_name = {part.name: part for part in head.parts}
    eye = material_of("eye").uniforms(by_name["left_eye"], theme, seen)
    assert (eye["iris_colour"], eye["sclera_colour"], eye["glow"]) == (theme.iris, theme.sclera, theme.glow)
    assert 0.1 < eye["pupil_radius"] < eye["iris_radius"] < 0.6 and eye["lids"] == 1.0
    face = material_of("skin").uniforms(by_name["face"], theme, seen)
    assert face == {"wrap": theme.wrap, "through": theme.through, "gloss_scale": 1.5, "detail_strength": 0.0}
    assert material_of("skin").uniforms(by_name["face"], THEMES["skin"], seen)["detail_strength"] == pytest.approx(0.16)
    teeth, mouth = (material_of(name).uniforms(by_name[name], theme, seen) for name in ("teeth", "mouth"))
    assert teeth["opening_area"] is seen.mouth()["opening_area"]
    assert teeth["wrap"] == pytest.approx((0.3, 0.18, 0.18))
    assert sum(teeth["albedo"]) > 2.5 * sum(mouth["albedo"]) and teeth["wetness"] > mouth["wetness"] > 0
    assert material_of("lash").uniforms(by_name["face"], theme, seen)["albedo"] == theme.lash
    assert material_of("brow").uniforms(by_name["face"], theme, seen)["albedo"] == theme.brow


def test_flags_and_order_of_materials() -> None:
    assert {name for name, one in MATERIALS.items() if one.two_sided} == {"lash", "brow", "mouth", "tress", "cloth"}
    assert {name for name, one in MATERIALS.items() if one.blended} == {"lash", "brow"}
    ordered = ["strand", "cloth", "skin", "eye", "lash", "teeth", "tongue", "gums", "mouth"]
    assert [material_of(name).order for name in ordered] == sorted({material_of(name).order for name in ordered})
    assert material_of("brow").order == material_of("lash").order


def test_each_eye_has_uniforms_of_its_own_and_other_parts_share_them() -> None:
    keys = {part.name: uniforms_key(part) for part in BallHead().parts}
    assert keys["left_eye"] != keys["right_eye"]
    one, two = skin(), skin()
    two.name = "neck"
    assert uniforms_key(one) == uniforms_key(two) != keys["teeth"]


def test_pores_are_dark_pits_that_a_coarser_level_of_the_texture_lacks() -> None:
    right, up, _, dark = np.moveaxis(_pores(np.random.default_rng(3)), -1, 0)
    coarse = dark.reshape(16, 8, 16, 8).mean(axis=(1, 3))
    assert coarse.std() < 0.4 * dark.std() and abs(dark.mean()) < 1e-9
    assert -dark.min() > 2.0 * dark.max()  # pits, no bumps
    bottom = dark < np.quantile(dark, 0.005)
    assert np.hypot(right, up)[bottom].mean() < 0.7 * np.hypot(right, up).mean()  # level where they are deepest
    np.testing.assert_allclose([right.mean(), up.mean()], 0.0, atol=1e-9)  # so that sides of the tile meet


def test_the_detail_texture_tiles_and_is_even(gl: None) -> None:
    ctx = open_context()
    try:
        data = np.frombuffer(detail_texture(ctx).read(), np.uint8).reshape(128, 128, 4).astype(float)
        again = np.frombuffer(detail_texture(ctx).read(), np.uint8)
    finally:
        ctx.release()
    assert (again == data.ravel()).all()
    assert data.mean(axis=(0, 1)) == pytest.approx(np.full(4, 127.5), abs=1.5)
    assert data.std(axis=(0, 1)) == pytest.approx(np.full(4, 0.17 * 255), rel=0.05)
    for axis in (0, 1):
        step = np.abs(np.diff(data, axis=axis)).mean()
        seam = np.abs(data.take(0, axis) - data.take(-1, axis)).mean()
        assert seam == pytest.approx(step, rel=0.3)
    power = np.abs(np.fft.fft2(data - data.mean(axis=(0, 1)), axes=(0, 1))) ** 2
    low = power[[0, 0, 1, 1, 2], [1, 2, 0, 1, 0]].sum(axis=0) / power.sum(axis=(0, 1))
    assert low.max() < 1e-3, "nothing that shows as a pattern"
    ratio = power[4:12, 4:12].mean(axis=(0, 1)) / power[40:60, 40:60].mean(axis=(0, 1))
    assert ratio[3] > 3 * ratio[:3].max(), "mottling is coarser than bumps"


def test_what_is_inside_the_mouth_is_reddish_and_teeth_are_nearly_white() -> None:
    head = BallHead()
    seen, part = Openings(head.parts), head.parts[3]
    given = {
        name: material_of(name).uniforms(part, THEMES["skin"], seen) for name in ("teeth", "tongue", "gums", "mouth")
    }
    assert {name: (*one["albedo"], one["wrap"][0], one["wetness"]) for name, one in given.items()} == {
        "teeth": (0.76, 0.71, 0.62, 0.3, 0.30), "tongue": (0.53, 0.20, 0.18, 0.4, 0.42),
        "gums": (0.57, 0.25, 0.23, 0.3, 0.20), "mouth": (0.46, 0.16, 0.15, 0.3, 0.20),
    }  # fmt: skip
    for one in given.values():
        assert one["wrap"][1:] == pytest.approx([0.6 * one["wrap"][0]] * 2)
    bare = material_of("teeth").static(part, THEMES["skin"], seen)["shade"]
    assert bare.shape == (len(part.vertices), 2) and (bare[:, 0] == 1.0).all()
    furrow = material_of("tongue").static(part, THEMES["skin"], seen)["shade"][:, 0]
    upper = part.normals[:, 1] > 0.5
    middle = np.abs(part.vertices[:, 0] - np.median(part.vertices[:, 0])) < 1.0
    assert (furrow[~upper & (part.normals[:, 1] <= 0.0)] == 1.0).all()
    assert not (upper & middle).any() or furrow[upper & middle].max() < 0.9


def test_hair_fades_towards_its_tip_and_brows_at_their_edges_too() -> None:
    head = BallHead()
    lash, brow = (
        material_of(name).uniforms(head.parts[0], THEMES["skin"], Openings(head.parts)) for name in ("lash", "brow")
    )
    assert (lash["fade"], lash["edges"]) == ((0.85, 0.15, 0.0, 0.0), 0.0)
    assert (brow["fade"], brow["edges"]) == ((0.52, 0.36, 0.34, 0.92), 1.0)
    eye = material_of("eye").uniforms(head.parts[1], THEMES["skin"], Openings(head.parts))
    assert (eye["iris_radius"], eye["pupil_radius"]) == pytest.approx((0.49, 0.185), rel=1e-3)


@pytest.mark.parametrize("simplified", [True, False])
@pytest.mark.parametrize("theme", THEMES)
def test_a_shader_of_skin_knows_seams_of_masks_and_the_texels_of_unfiltered_grain(
    monkeypatch: pytest.MonkeyPatch, theme: str, simplified: bool
) -> None:
    given: list[dict[str, object]] = []
    monkeypatch.setattr("surface.view.draw.materials.build", lambda *names, defines, **_: given.append(defines))
    for quality in ("full", "fast"):
        skin_program(None, quality, THEMES[theme], simplified=simplified)  # type: ignore[arg-type]
    seams = {"SEAMS": 1, "DETAIL_PER_RADIAN": "2.86479"} if theme == "mask" else {}  # 18 tiles around
    grain = {"GRAIN_TEXELS": "64.0"} if simplified else {}
    panels = {"PANELS": 1, "DETAIL_PER_RADIAN": "2.86479"} if theme == "robot" else {}
    assert given == [{"INSIDE": "0.25"} | seams | panels | grain, {"INSIDE": "0.25"} | panels]


def test_lashes_of_many_strips_are_upper_or_lower_by_their_height() -> None:
    heights = [3.0, 2.0, -1.0, -2.0]
    at = np.array([[0.0, y, 0.0] for y in heights])
    part = BallPart("lashes", "lash", np.array([[0, 1, 2]]), at, np.zeros((4, 3)))
    part.uv[:] = [(2.0 * k + 0.5, 0.5) for k in range(4)]
    along = material_of("lash").static(part, THEMES["skin"], openings())["along"]
    assert along[:, 2] == pytest.approx([1.0, 1.0, 0.42, 0.42]) and along[:, 0] == pytest.approx([0.5] * 4)


def test_bumps_have_no_waves_longer_than_a_third_of_the_texture_and_all_shorter_ones(gl: None) -> None:
    ctx = open_context()
    try:
        texture = detail_texture(ctx)
        data = np.frombuffer(texture.read(), np.uint8).reshape(128, 128, 4).astype(float)
        assert texture.filter == (ctx.LINEAR_MIPMAP_NEAREST, ctx.LINEAR)
    finally:
        ctx.release()
    power = (np.abs(np.fft.fft2(data - data.mean(axis=(0, 1)), axes=(0, 1))) ** 2).mean(axis=2)
    frequency = np.hypot(*np.meshgrid(*[np.fft.fftfreq(128) * 128] * 2))
    typical = power[(frequency > 2.2) & (frequency < 4.0)].mean()
    assert power[(frequency > 0) & (frequency <= 2.0)].max() < 1e-3 * typical
    assert power[(frequency > 2.0) & (frequency < 2.3)].mean() > 0.2 * typical
    assert len(np.unique(data)) > 200
