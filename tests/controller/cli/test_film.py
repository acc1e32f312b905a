"""``omote render --take``: films of takes and shows as a user makes them."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from PIL import Image
from typer.testing import CliRunner

from controller.base.errors import ConfigError
from controller.cli.app import make_app
from controller.cli.film import _sound_of
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


def film(folder: Path, out: str, *more: str, take: str = "hello.toml") -> str:
    words = ["render", "--head", str(folder / "small"), "--size", "64x48", "--rate", "5", "-o", str(folder / out)]
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


@pytest.mark.parametrize("sound", ["../hello.wav", "/etc/hostname", ""])
def test_a_show_names_no_sound_of_other_folders(folder: Path, sound: str) -> None:
    (folder / "hello.toml").write_text(SHOW.replace("hello.wav", sound))
    with pytest.raises(ConfigError, match="sound: must be a file in the folder"):
        film(folder, "hello.mp4")


@pytest.mark.parametrize("name", ["a.wav", "A.MP3", "a.webm"])
def test_a_take_that_is_a_voice_is_its_own_sound(name: str) -> None:
    assert _sound_of(Path(name)) == Path(name)


def test_a_take_without_a_voice_has_no_sound() -> None:
    assert _sound_of(Path("a.csv")) is None
