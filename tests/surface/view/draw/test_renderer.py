"""surface.view.draw.renderer"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ball_head import RADII, BallHead, BallPart, ball, grid, values

from surface.base.errors import ViewError
from surface.head import Head
from surface.view import Camera, Offscreen, Theme
from surface.view.draw import materials
from surface.view.draw.renderer import light_direction
from surface.view.scene.bounds import Bands
from surface.view.scene.theme import THEMES, Light, find_theme

SIZE = (200, 160)


@pytest.fixture(scope="module")
def screens(gl: None) -> Iterator[dict[str, Offscreen]]:
    made = {quality: Offscreen(BallHead(), SIZE, quality=quality) for quality in ("full", "fast")}
    yield made
    for screen in made.values():
        screen.close()


@pytest.fixture(params=["full", "fast"])
def screen(request: pytest.FixtureRequest, screens: dict[str, Offscreen]) -> Offscreen:
    return screens[request.param]


def middle(picture: np.ndarray, x: float, y: float) -> np.ndarray:
    """Mean colour round a place given in 0..1 from the upper left corner."""
    row, column = int(y * SIZE[1]), int(x * SIZE[0])
    return picture[row - 3 : row + 4, column - 3 : column + 4].reshape(-1, 3).mean(axis=0)


def test_skin_is_warm_lit_and_not_blown(screen: Offscreen) -> None:
    picture = screen.render(values())
    red, green, blue = middle(picture, 0.5, 0.35)
    assert red > green > blue
    assert 120 < red < 250
    assert (picture[SIZE[1] // 2] < 253).all()


def test_the_key_light_comes_from_the_subjects_right(screen: Offscreen) -> None:
    picture = screen.render(values())
    assert middle(picture, 0.42, 0.55).sum() > middle(picture, 0.58, 0.55).sum() + 10


def test_opening_the_mouth_changes_the_mouth_only(screen: Offscreen) -> None:
    shut = screen.render(values()).astype(int)
    opened = screen.render(values(jawOpen=1.0)).astype(int)
    moved = np.abs(opened - shut).max(axis=2) > 12
    assert moved[SIZE[1] // 2 :].sum() > 60
    assert moved[: SIZE[1] // 2].sum() == 0


def test_yaw_turns_to_the_subjects_left(screen: Offscreen) -> None:
    ahead = screen.render(values()).astype(float)
    turned = screen.render(values(headYaw=0.4)).astype(float)
    columns = np.arange(SIZE[0])[None, :]
    red = ahead[..., 0] - ahead[..., 2]
    eyes = slice(int(0.40 * SIZE[1]), int(0.47 * SIZE[1]))
    dark_ahead = np.clip(150 - ahead[eyes, 70:130].sum(axis=2) / 3, 0, None)
    dark_turned = np.clip(150 - turned[eyes, 70:130].sum(axis=2) / 3, 0, None)
    assert red.max() > 20
    centre_ahead = (dark_ahead * columns[:, 70:130]).sum() / dark_ahead.sum()
    centre_turned = (dark_turned * columns[:, 70:130]).sum() / dark_turned.sum()
    assert centre_turned > centre_ahead + 1


def test_gaze_moves_the_pupils(screen: Offscreen) -> None:
    camera = Camera.around(0, 0, distance=200, target=(30, 20, 80))

    def dark(amount: float) -> float:
        picture = screen.render(values(leftEyeYaw=amount), camera).astype(float).sum(axis=2)
        window = picture[60:100, 60:140]
        weight = np.clip(120 - window, 0, None)
        return float((weight * np.arange(80)).sum() / weight.sum())

    assert dark(0.5) > dark(0.0) + 4
    assert dark(-0.5) < dark(0.0) - 4


def test_the_iris_of_a_dark_eye_is_dark(gl: None) -> None:
    """A pale ring around the pupil made it amber."""
    camera, red = Camera.around(0, 0, distance=200, target=(30, 20, 80)), {}
    for iris in ((0.16, 0.07, 0.037), (0.016, 0.007, 0.0037)):
        with Offscreen(BallHead(), SIZE, theme=replace(find_theme("skin"), iris=iris)) as screen:
            picture = screen.render(values(), camera).astype(float)
        row = picture[80]
        pupil = np.flatnonzero(row.sum(axis=1) < 3.0)[0]
        red[iris[0]] = row[pupil - 9 : pupil - 3, 0].mean()
    assert red[0.016] < 0.45 * red[0.16]


def test_the_picture_depends_on_the_pose_alone(screen: Offscreen) -> None:
    first = screen.render(values())
    screen.render(values(jawOpen=1, headYaw=-1, eyeBlinkLeft=1), Camera.profile())
    assert np.abs(screen.render(values()).astype(int) - first).max() <= 1


def test_region_holds_everything_that_differs_from_the_background(screen: Offscreen) -> None:
    camera = Camera.three_quarter()
    picture = screen.render(values(headYaw=0.3), camera).astype(int)
    bands = screen.renderer.region(camera, SIZE)
    screen.renderer.draw(camera.aimed((5000.0, 0.0, 0.0)), screen.target._drawn)
    screen.target._pending = Bands.whole(SIZE)
    differs = np.flipud(np.abs(picture - screen.read()).max(axis=2) > 2)
    inside = np.zeros_like(differs)
    for left, bottom, right, top in bands.boxes():
        inside[bottom:top, left:right] = True
    assert differs.any()
    assert not differs[~inside].any()
    assert inside.mean() < 0.5


def test_a_camera_inside_the_head_draws_the_whole_picture(screen: Offscreen) -> None:
    assert screen.renderer.region(Camera((0, 0, 10), (0, 0, 100)), SIZE).box() == (0, 0, *SIZE)


def test_both_qualities_agree(screens: dict[str, Offscreen]) -> None:
    full, fast = (screens[q].render(values(jawOpen=0.5)).astype(float) for q in ("full", "fast"))
    assert np.abs(full - fast).mean() < 2.5


def test_background_can_be_changed(screen: Offscreen) -> None:
    theme = screen.renderer.theme
    screen.renderer.set_background((0.0, 0.0, 1.0), (0.0, 1.0, 0.0))
    picture = screen.render(values())
    screen.renderer.set_background(theme.background_top, theme.background_bottom)
    assert picture[2, SIZE[0] // 2, 2] > 150
    assert picture[-3, SIZE[0] // 2, 1] > 150
    assert screen.render(values())[2, SIZE[0] // 2, 2] < 120


def test_themes_differ(gl: None) -> None:
    with Offscreen(BallHead(), SIZE, theme="mask") as screen:
        red, _, blue = middle(screen.render(values()), 0.5, 0.35)
    assert abs(red - blue) < 25


def test_names_that_do_not_exist(gl: None) -> None:
    with pytest.raises(ViewError, match="'clown'") as caught:
        find_theme("clown")
    assert "skin" in caught.value.hint
    assert find_theme(Theme(gloss=2.0)).gloss == 2.0
    with pytest.raises(ValueError, match="'best'"):
        Offscreen(BallHead(), SIZE, quality="best")


@pytest.mark.parametrize("name", THEMES)
def test_lights_come_from_where_the_theme_says(name: str) -> None:
    key = light_direction(THEMES[name].key, 0.0)
    assert np.linalg.norm(key) == pytest.approx(1.0, abs=1e-6)
    assert key[0] < 0 < key[1]
    assert light_direction(Light(0, 0, (1, 1, 1)), 90.0) == pytest.approx([1, 0, 0], abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("quality", ["full", "fast"])
def test_the_shipped_head_looks_at_you(gl: None, root: Path, quality: str) -> None:
    head = Head.load(root / "configs" / "heads" / "ict")
    camera, size = Camera.front(), (480, 480)
    with Offscreen(head, size, quality=quality) as screen:
        picture = screen.render(np.zeros(len(head.parameters)), camera).astype(int)
    for part in (p for p in head.parts if p.material == "eye"):
        column, row = pixel(camera, part.vertices[np.argmax(part.vertices[:, 2])], size)
        around = picture[row - 3 : row + 4, column - 14 : column + 15]
        assert around[:, 10:19].sum(axis=2).min() < 120, "a dark pupil"
        assert around[:, :8].sum(axis=2).max() > 270, "white beside it"
        assert around[:, -8:].sum(axis=2).max() > 270, "white on the other side"
    face = picture[120:300, 180:300]
    assert (face.max(axis=2) > 250).mean() < 0.003, "nothing blown out"
    assert (face.sum(axis=2) < 45).mean() < 0.02, "no black holes"
    assert (face[..., 0] > face[..., 2]).mean() > 0.9, "warm skin"


def pixel(camera: Camera, point: np.ndarray, size: tuple[int, int]) -> tuple[int, int]:
    """Column and row of a point in head space."""
    clip = camera.matrix(size[0] / size[1]).astype(float) @ [*point, 1.0]
    return int((clip[0] / clip[3] * 0.5 + 0.5) * size[0]), int((0.5 - clip[1] / clip[3] * 0.5) * size[1])


@pytest.mark.parametrize("quality", ["full", "fast"])
@pytest.mark.parametrize(("yaw_deg", "pitch_deg", "inside", "outside"), [(180, -10, 0.59, 0.3), (0, -50, 0.8, 0.12)])
def test_a_hollow_bust_is_dark_inside(
    gl: None, quality: str, yaw_deg: float, pitch_deg: float, inside: float, outside: float
) -> None:
    head = BallHead()
    skin = head.parts[0]
    skin.triangles = skin.triangles[skin.rest[skin.triangles].mean(axis=1)[:, 1] > 0.0]  # all below is cut away
    camera = Camera.around(yaw_deg, pitch_deg, target=(0.0, 20.0, 0.0), fov_deg=12.0)
    with Offscreen(head, SIZE, quality=quality) as screen:
        picture = screen.render(values(), camera)
    dark = middle(picture, 0.5, inside)
    assert dark.sum() < 0.5 * middle(picture, 0.5, outside).sum()
    assert np.abs(dark - middle(picture, 0.04, inside)).max() > 15, "no hole through which the background shows"


class Bearded(BallHead):
    """Lashes over a whole ball, as deep under the skin as is asked for."""

    def __init__(self, depth_mm: float) -> None:
        super().__init__()
        points, normals, triangles = ball(RADII - depth_mm, 61, 81)
        hair = BallPart("lashes", "lash", triangles, points, normals)
        hair.uv[:] = 0.5, 0.1
        self.parts = (*self.parts, hair)


@pytest.mark.parametrize(("depth_mm", "shown"), [(1.0, True), (3.0, False)])
def test_skin_hides_hair_only_where_it_is_well_under_it(gl: None, depth_mm: float, shown: bool) -> None:
    with Offscreen(BallHead(), SIZE) as bare, Offscreen(Bearded(depth_mm), SIZE) as bearded:
        forehead = middle(bare.render(values()), 0.5, 0.3), middle(bearded.render(values()), 0.5, 0.3)
    assert (forehead[1].sum() < 0.6 * forehead[0].sum()) == shown
    if not shown:
        assert forehead[1] == pytest.approx(forehead[0])


def test_a_hurried_picture_is_hardly_another(screen: Offscreen) -> None:
    calm = screen.render(values(jawOpen=0.4)).astype(int)
    screen.renderer.hurry()
    screen.renderer.revision += 1
    hurried = screen.render(values(jawOpen=0.4)).astype(int)
    assert np.abs(calm - hurried).mean() < 0.5
    assert (calm != hurried).any() == (screen.renderer.quality == "full")


@pytest.mark.parametrize(
    ("yaw", "pitch", "turn", "wanted"),
    [
        (0, 0, 0, (0, 0, 1)),
        (90, 0, 0, (1, 0, 0)),
        (0, 90, 0, (0, 1, 0)),
        (30, 0, 60, (1, 0, 0)),
        (0, 30, 0, (0, 0.5, 0.75**0.5)),
        (180, 30, 0, (0, 0.5, -(0.75**0.5))),
        (90, 60, 0, (0.5, 0.75**0.5, 0)),
    ],
)
def test_light_directions(yaw: float, pitch: float, turn: float, wanted: tuple[float, float, float]) -> None:
    assert light_direction(Light(yaw, pitch, (1, 1, 1)), turn) == pytest.approx(wanted, abs=1e-6)


def test_camera_lights_and_theme_reach_the_programs(screen: Offscreen) -> None:
    renderer, camera = screen.renderer, Camera.around(40.0, 10.0)
    screen.render(values(headYaw=0.5), camera)
    program, theme = renderer._programs["skin"], renderer.theme

    def held(name: str) -> np.ndarray | None:
        uniform = program.get(name, None)
        return None if uniform is None else np.array(uniform.value)

    turn = theme.lights_follow * 40.0
    wanted = {
        "view_projection": camera.matrix(SIZE[0] / SIZE[1]).T.ravel(),
        "camera": camera.eye,
        "sky": theme.sky,
        "ground": theme.ground,
        **{f"{name}_colour": getattr(theme, name).colour for name in ("key", "fill", "rim")},
        **{f"{name}_direction": light_direction(getattr(theme, name), turn) for name in ("key", "fill", "rim")},
    }
    found = {name: held(name) for name in wanted}
    assert sum(value is not None for value in found.values()) >= 8
    for name, value in found.items():
        if value is not None:
            assert value == pytest.approx(np.array(wanted[name]), rel=1e-6, abs=1e-5), name


def test_pictures_are_drawn_again_when_only_the_aspect_changes(gl: None) -> None:
    with Offscreen(BallHead(), (100, 60)) as wide, Offscreen(BallHead(), (60, 100)) as tall:
        camera = Camera.front()
        before = wide.render(values(), camera)
        tall.render(values(), camera)
        wide.renderer.draw(camera, tall.target._drawn)
        assert wide.renderer._camera == (camera, 0.6)
        assert (wide.render(values(jawOpen=0.1), camera) != before).any()
        assert wide.renderer._camera == (camera, 100 / 60)


def test_the_revision_grows_only_with_what_was_sent(gl: None) -> None:
    with Offscreen(BallHead(), (40, 40)) as screen:
        renderer = screen.renderer
        renderer.pose(values(jawOpen=0.3))
        assert renderer.update() == sum(len(part.vertices) for part in screen.head.parts)
        assert renderer.revision == 1
        for part in screen.head.parts:
            part.changed = []
        assert renderer.update() == 0 and renderer.revision == 1


def test_many_rectangles_get_a_larger_buffer(gl: None) -> None:
    with Offscreen(BallHead(), (64, 2000)) as screen:
        background = screen.renderer._background
        size = background._corners.size
        screen.render(values())
        assert background._corners.size > size
        assert screen.read()[:, 0].max(axis=1).min() > 20, "background in every row"


@pytest.mark.parametrize(
    ("camera", "inside"),
    [
        (Camera.around(0.0, -11.5), False),
        (Camera.around(0.0, -12.5), True),
        (Camera.around(0.0, 40.0), False),
        (Camera.around(180.0, 0.0), True),
        (Camera((900.0, 0.0, 0.0)), False),
        (Camera((900.0, 0.0, -0.5)), True),
    ],
)
def test_the_hollow_bust_is_seen_from_behind_and_from_well_below(
    screen: Offscreen, camera: Camera, inside: bool
) -> None:
    screen.render(values(), camera)
    assert screen.renderer._into_bust == inside


def test_lights_follow_half_of_the_cameras_turn_and_none_of_the_pose(screen: Offscreen) -> None:
    program = screen.renderer._programs["skin"]
    if "key_at_rest" not in program:
        pytest.skip("this quality computes no shade that is baked at rest")
    screen.render(values(), Camera.around(30.0))
    wanted = light_direction(screen.renderer.theme.key, 15.0)
    assert np.array(program["key_at_rest"].value) == pytest.approx(wanted, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("quality", ["full", "fast"])
@pytest.mark.parametrize(("material", "seen"), [("mouth", True), ("teeth", False), ("skin", False)])
def test_backs_are_drawn_of_two_sided_materials_only(gl: None, quality: str, material: str, seen: bool) -> None:
    """A sheet before the face that looks away from the camera."""
    uv, triangles = grid(5, 5)
    points = np.column_stack([60.0 * (uv - 0.5), np.full(len(uv), 130.0)])
    back = BallPart("sheet", material, triangles[:, ::-1].copy(), points, np.tile([0.0, 0.0, -1.0], (len(uv), 1)))
    drawn = []
    for more in ((), (back,)):
        head = BallHead()
        head.parts = (*head.parts, *more)
        with Offscreen(head, SIZE, quality=quality) as screen:
            drawn.append(screen.render(values()).astype(int))
    assert (np.abs(middle(drawn[1], 0.5, 0.5) - middle(drawn[0], 0.5, 0.5)).max() > 20.0) == seen


class HairyHead(BallHead):
    """A ball whose upper half has strands that thin out downwards."""

    def __init__(self) -> None:
        super().__init__()
        points, normals, triangles = ball(1.03 * RADII, 61, 81)
        high = points[:, 1] / RADII[1]
        uv = np.column_stack([4.0 * np.arctan2(points[:, 0], points[:, 2]), 2.0 * high])
        strands = np.column_stack([uv, np.clip(0.5 + 1.2 * high, 0.0, 1.0), np.ones(len(points))])
        cap = BallPart("hair", "strand", triangles, points, normals)
        cap.attributes = {"strands": strands.astype(np.float32), "albedo": np.full((len(points), 3), 0.02, np.float32)}
        self.parts = (*self.parts, cap)


def test_strands_cover_a_share_of_a_pixel_where_it_has_several_samples(
    gl: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """About as much hair as with whole pixels, but without their steps; strands fade over some of their height."""
    pictures = []
    for covering in (True, False):
        whole = replace(materials.MATERIALS["strand"], covering=covering)
        monkeypatch.setitem(materials.MATERIALS, "strand", whole)
        with Offscreen(HairyHead(), SIZE, samples=4) as screen:
            pictures.append(screen.render(values()).astype(int))
    shared, stepped = pictures
    steps = [int((np.abs(np.diff(picture[60:100], axis=1)).max(axis=2) > 90).sum()) for picture in pictures]
    assert 0 < steps[0] < 0.75 * steps[1]
    assert shared.mean() == pytest.approx(stepped.mean(), rel=0.02)


def blocks(picture: np.ndarray) -> np.ndarray:
    """Means over squares of five pixels of a picture's middle."""
    return np.asarray(picture[40:100, 50:150].reshape(12, 5, 20, 5, 3).mean(axis=(1, 3)))


def test_strands_fade_pixel_by_pixel_where_it_has_one_sample(gl: None) -> None:
    """Seen from afar they are as thick as with several samples, and no blots."""
    drawn = []
    for samples in (4, 1):
        with Offscreen(HairyHead(), SIZE, samples=samples) as screen:
            drawn.append(blocks(screen.render(values()).astype(float)))
    assert np.abs(drawn[1] - drawn[0]).mean() < 5.4


@pytest.mark.parametrize("quality", ["full", "fast"])
@pytest.mark.parametrize(("red", "mirrored"), [(0.08, True), (0.6, False)])
def test_the_surface_of_dark_skin_mirrors_what_is_above(gl: None, quality: str, red: float, mirrored: bool) -> None:
    """The key light, whose highlights follow the gloss on every skin, is off."""
    theme, shown = replace(find_theme("skin"), key=Light(-34.0, 32.0, (0.0, 0.0, 0.0))), []
    for gloss in (0.0, 0.24):
        head = BallHead()
        skin = head.parts[0]
        skin.attributes["albedo"] = np.tile(np.float32([red, 0.5 * red, 0.4 * red]), (len(skin.rest), 1))
        skin.attributes["gloss"] = np.full((len(skin.rest), 1), gloss, np.float32)
        with Offscreen(head, SIZE, quality=quality, theme=theme) as screen:
            picture = screen.render(values()).astype(int)
            shown.append([middle(picture, 0.5, at).sum() for at in (0.3, 0.8)])
    forehead, chin = np.subtract(shown[1], shown[0])
    assert (forehead > chin + 20.0) == mirrored and (mirrored or forehead == chin == 0.0), (forehead, chin)


@pytest.mark.parametrize("theme", sorted(THEMES))
@pytest.mark.parametrize("quality", ["full", "fast"])
def test_pupils_widen_in_both_eyes_alike_and_nothing_else_does(gl: None, quality: str, theme: str) -> None:
    head = BallHead()
    with Offscreen(head, SIZE, quality=quality, theme=theme) as screen:
        rest = screen.render(values()).astype(int)
        seen = []
        for pupil in (0.2, -0.2):
            head.pupil = pupil
            revision = screen.renderer.revision
            changed = np.abs(screen.render(values()).astype(int) - rest).max(axis=2) > 2
            assert screen.renderer.revision > revision
            seen.append(screen.renderer._programs["eye"]["pupil_radius"].value)
            left, right = changed[:, : SIZE[0] // 2].sum(), changed[:, SIZE[0] // 2 :].sum()
            assert left > 0 and right > 0 and abs(int(left) - int(right)) <= 0.5 * max(left, right)
            assert changed.sum() < 0.01 * changed.size
        assert seen[0] / seen[1] == pytest.approx(1.5)
        head.pupil = 0.0
        np.testing.assert_array_equal(screen.render(values()), rest)


def test_a_pupil_always_leaves_a_rim_of_the_iris(gl: None) -> None:
    head = BallHead()
    with Offscreen(head, SIZE, theme=replace(find_theme("skin"), key=Light(0.0, 0.0, (0.0, 0.0, 0.0)))) as screen:
        head.pupil = 9.0
        screen.render(values())
        program = screen.renderer._programs["eye"]
        assert program["pupil_radius"].value == pytest.approx(0.75 * program["iris_radius"].value)
