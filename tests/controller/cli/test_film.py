"""``omote render --take``: films of takes and shows as a user makes them."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from controller.base.errors import ConfigError, ControllerError
from controller.base.parameters import PARAMETERS
from controller.cli.app import make_app
from controller.cli.film import _sound_of
from controller.face.still import Still
from controller.stage.stage import load_stage
from controller.takes.recording import recorded
from surface.base import ffmpeg
from surface.base.errors import ViewError
from surface.head import save_data
from tests.surface.small_head import small_head
from tests.surface.view.pictures.test_clip import heard, needs_ffmpeg, write_tone

SHOW = 'name = "hello"\nsound = "hello.wav"\nsteps = ["0 EXPR smile 1", "0.2 NEUTRAL"]\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    save_data(tmp_path / "small", small_head())
    (tmp_path / "hello.toml").write_text(SHOW)
    write_tone(tmp_path / "hello.wav", 1.0)
    return tmp_path


def film(folder: Path, out: str, *more: str, take: str = "hello.toml", stage: str | None = None) -> str:
    words = ["render", "--size", "64x48", "--rate", "5", "-o", str(folder / out)]
    words += ["--head", str(folder / "small")] if stage is None else ["--stage", str(folder / stage)]
    said = CliRunner().invoke(make_app(), [*words, "--take", str(folder / take), *more])
    if said.exception is not None and not isinstance(said.exception, SystemExit):
        raise said.exception
    return " ".join(said.output.split())


@needs_ffmpeg
def test_a_show_becomes_a_film_with_its_sound(folder: Path) -> None:
    said = film(folder, "hello.mp4")
    assert "12 frames at 5 per second, with the sound of" in said and "wrote" in said
    assert abs(heard(folder / "hello.mp4")[1600:14_000]).max() > 3000
    command = [str(ffmpeg.find_ffmpeg()), "-i", str(folder / "hello.mp4"), "-f", "null", "-"]
    told = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stderr
    assert "Video: h264" in told and "64x48" in told and "Audio: aac" in told and "frame=   12" in told


@needs_ffmpeg
def test_a_voice_is_the_sound_of_its_own_film(folder: Path) -> None:
    assert "hello.wav" in film(folder, "voice.mp4", take="hello.wav")
    assert abs(heard(folder / "voice.mp4")).max() > 3000


def test_a_webp_needs_no_ffmpeg_and_has_no_sound(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ffmpeg, "find_ffmpeg", lambda: None)
    assert "without the sound of" in film(folder, "hello.webp")
    with Image.open(folder / "hello.webp") as clip:
        assert clip.format == "WEBP" and clip.size == (64, 48)


def test_without_ffmpeg_the_message_says_what_to_type(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ffmpeg, "find_ffmpeg", lambda: None)
    with pytest.raises(ViewError, match="needs ffmpeg, which is not installed") as caught:
        film(folder, "hello.mp4")
    assert "pip install imageio-ffmpeg" in caught.value.hint and not (folder / "hello.mp4").exists()


def test_what_a_film_cannot_have_is_named(folder: Path) -> None:
    with pytest.raises(ViewError, match="has no sound"):
        film(folder, "hello.gif", "--sound", str(folder / "hello.wav"))
    with pytest.raises(ConfigError, match="--take and --sheet draw different pictures"):
        film(folder, "hello.mp4", "--sheet")
    said = CliRunner().invoke(make_app(), ["render", "-o", "a.png", "--sound", "hello.wav"])
    assert isinstance(said.exception, ConfigError) and "there is no --take" in str(said.exception)


DUET = """
liveliness = 1.0
head = "small"
vocabularies = ["mine.toml"]
[[heads]]
name = "maple"
[[heads]]
name = "oak"
[[heads]]
name = "elm"
head = "other"
"""


@pytest.fixture
def duet(folder: Path) -> Path:
    """A folder with a stage of three heads, two of which look alike, and a show that only that stage understands."""
    save_data(folder / "other", small_head(eyes=np.array([[25.0, 20, 0], [-25, 20, 0]])))
    (folder / "mine.toml").write_text("[kissing]\nweights = { mouthPucker = 1.0 }\n")
    (folder / "duet.toml").write_text(f'name = "duet"{DUET}')
    lines = '"0 LIFE 0", "0.2 @oak EXPR kissing 1", "0.2 @elm SET headYaw 1", "0.4 @all NEUTRAL"'
    (folder / "kiss.toml").write_text(f'name = "kiss"\nloop_s = 1.0\nsteps = [{lines}]\n')
    return folder


def test_a_film_of_a_stage_of_several_heads_shows_them_all_and_alike_each_time(duet: Path) -> None:
    for out in ("a.webp", "b.webp"):
        assert "6 frames at 5 per second" in film(duet, out, take="kiss.toml", stage="duet.toml")
    assert (duet / "a.webp").read_bytes() == (duet / "b.webp").read_bytes()
    with Image.open(duet / "a.webp") as clip:
        assert clip.size == (64, 48)
        frames = []
        for number in range(getattr(clip, "n_frames", 1)):
            clip.seek(number)
            frames.append(np.asarray(clip.convert("RGB")).astype(int))
    maple, oak, elm = (np.abs(frames[2] - frames[0])[:, 21 * k : 21 * (k + 1)].max() for k in range(3))
    assert maple < 10 and oak > 20 and elm > 20  # who is commanded to, moves


def test_a_picture_of_a_stage_of_several_heads_shows_them_all(duet: Path) -> None:
    words = ["render", "--stage", str(duet / "duet.toml"), "--size", "96x48", "-o", str(duet / "a.png")]
    assert CliRunner().invoke(make_app(), words).exit_code == 0
    with Image.open(duet / "a.png") as picture:
        tiles = np.asarray(picture.convert("RGB")).reshape(picture.height, picture.width, 3)
    assert picture.width > 96
    width = picture.width // 3
    assert all(np.ptp(tiles[:48, k * width + 8 : (k + 1) * width - 8].astype(int)) > 60 for k in range(3))


@pytest.mark.parametrize("option", ["--sheet", "--crowd=4", "--identity=broad=1", "--group=brow.json"])
def test_what_draws_one_head_is_refused_for_several_and_says_how_one_is_named(duet: Path, option: str) -> None:
    (duet / "brow.json").write_text('{"format": 1, "part": "a", "ids": [12], "moves_mm": [[0, 3, 0]]}')
    option = option.replace("brow.json", str(duet / "brow.json"))
    words = ["render", "--stage", str(duet / "duet.toml"), "-o", str(duet / "a.png"), option]
    error = CliRunner().invoke(make_app(), words).exception
    assert isinstance(error, ConfigError) and "is for one head, and" in str(error) and "has 3" in str(error)
    assert f"--head {duet / 'small'}" in error.hint and not (duet / "a.png").exists()


def test_a_show_knows_the_expressions_of_its_stage(duet: Path) -> None:
    (duet / "show.toml").write_text('steps = ["0 EXPR kissing 1"]\n')
    (duet / "one.toml").write_text('name = "one"\nhead = "small"\n')
    with pytest.raises(ConfigError, match="unknown expression 'kissing'"):
        film(duet, "a.webp", take="show.toml", stage="one.toml")
    mine = ("--vocabulary", str(duet / "mine.toml"))
    assert "11 frames" in film(duet, "a.webp", *mine, take="show.toml", stage="one.toml")
    (duet / "one.toml").write_text('name = "one"\nhead = "small"\nliveliness = 0.5\n')
    assert "11 frames" in film(duet, "b.webp", *mine, take="show.toml", stage="one.toml")
    assert (duet / "a.webp").read_bytes() != (duet / "b.webp").read_bytes()


def test_a_recording_is_drawn_with_the_stage_that_it_is_of(duet: Path) -> None:
    (duet / "one.toml").write_text('name = "one"\nhead = "small"\n[layers.manual]\nweight = 0.5\n')
    out = PARAMETERS.neutral()
    with recorded(load_stage(str(duet / "one.toml"), PARAMETERS).state(), duet / "a.rec") as state:
        state.set_parameters([PARAMETERS.index("mouthPucker")], [1.0], 1)
        for k in range(50):
            state.tick(10_000_000 * (k + 1), 0.01, out)
    assert "3 frames" in film(duet, "a.webp", take="a.rec", stage="one.toml")
    with pytest.raises(ControllerError, match="came out differently"):
        film(duet, "b.webp", take="a.rec", stage="duet.toml")


@pytest.mark.parametrize("sound", ["../hello.wav", "/etc/hostname", ""])
def test_a_show_names_no_sound_of_other_folders(folder: Path, sound: str) -> None:
    (folder / "hello.toml").write_text(SHOW.replace("hello.wav", sound))
    with pytest.raises(ConfigError, match="sound: must be a file in the folder"):
        film(folder, "hello.mp4")


@pytest.mark.parametrize("name", ["a.wav", "A.MP3", "a.webm"])
def test_a_take_that_is_a_voice_is_its_own_sound(name: str) -> None:
    assert _sound_of(Path(name), Still.parse([], [])) == Path(name)


def test_a_take_without_a_voice_has_no_sound() -> None:
    assert _sound_of(Path("a.csv"), Still.parse([], [])) is None
