"""Readers of takes: which there are, and who reads what."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import TakeError
from controller.base.parameters import PARAMETERS as P
from controller.takes.reader import API, TAKES, TakeReader, load_take, reader_of, suffixes
from drivers.base.errors import PluginError

MODULE = """
import numpy as np
from controller.takes.livelink import Take
from controller.takes.reader import TakeReader
PLUGIN = TakeReader(api={api}, kind="{kind}", title="trial", suffixes={suffixes}, read="plugin_{kind}:{read}",
                    recognises="{recognises}")

def rest(path, parameters):
    n = len(parameters)
    return Take(path.name, np.arange(2.0), np.zeros((2, n)), np.ones(n, dtype=bool), parameters.low, parameters.high)

def nothing(path, parameters):
    return 3

def mine(start):
    return start.startswith(b"mine")

def broken(path, parameters):
    return 1 / 0
"""


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    """Adds a reader of another package."""
    monkeypatch.syspath_prepend(tmp_path)

    def add(kind: str, *taken: str, read: str = "rest", api: int = API, recognises: str = "") -> None:
        info = tmp_path / f"{kind}_package-1.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {kind}-package\nVersion: 1\n")
        (info / "entry_points.txt").write_text(f"[omote.takes]\n{kind} = plugin_{kind}:PLUGIN\n")
        (tmp_path / f"plugin_{kind}.py").write_text(
            MODULE.format(kind=kind, suffixes=taken, read=read, api=api, recognises=recognises)
        )

    yield add
    for name in [name for name in sys.modules if name.startswith("plugin_")]:
        del sys.modules[name]
    TAKES.clear()


def test_the_built_in_readers() -> None:
    assert {(reader.kind, reader.layer) for reader in TAKES.all()} == {
        ("livelink", "capture"), ("openface", "capture"), ("pyfeat", "capture"), ("plain", "capture"),
        ("sounds", "speech"), ("aeneas", "speech"), ("azure_visemes", "speech"), ("azure_shapes", "capture"),
        ("textgrid", "speech"), ("wav", "speech"), ("compressed", "speech"), ("mcap", "capture"),
        ("mediapipe", "capture"),
    }  # fmt: skip
    assert {".csv", ".json", ".tsv", ".wav", ".textgrid", ".mp3"} <= set(suffixes())
    assert len(set(suffixes())) == len(suffixes())
    assert all(isinstance(reader, TakeReader) and reader.api == API for reader in TAKES.all())


def test_one_built_in_reader_of_each_suffix_takes_what_no_other_recognises() -> None:
    for suffix in suffixes():
        those = [reader for reader in TAKES.all() if suffix in reader.suffixes]
        assert len(those) == 1 or sum(not reader.recognises for reader in those) == 1, suffix


@pytest.mark.parametrize(
    ("name", "text", "kind"),
    [
        ("a.csv", "Timecode,BlendShapeCount,JawOpen", "livelink"),
        ("A.CSV", "timecode, BlendshapeCount", "livelink"),
        ("a.csv", "frame, face_id, timestamp, confidence, success, AU01_r", "openface"),
        ("a.csv", "input,frame,FaceScore,AU01", "pyfeat"),
        ("a.csv", "time,jawOpen", "plain"),
        ("a.csv", "", "plain"),
        ("b.x.json", '{"mouthCues": []}', "sounds"),
        ("b.json", '{"fragments": []}', "aeneas"),
        ("b.json", '[{"audio_offset": 0, "viseme_id": 0}]', "azure_visemes"),
        ("b.json", '[{"privAudioOffset": 0, "privVisemeId": 0}]', "azure_visemes"),
        ("b.json", '{"FrameIndex": 0, "BlendShapes": []}', "azure_shapes"),
        ("b.json", json.dumps({"viseme_id": 0, "animation": json.dumps({"BlendShapes": []})}), "azure_shapes"),
        ("c.TextGrid", "", "textgrid"),
    ],
)
def test_a_reader_is_found_by_the_ending_and_the_first_bytes(tmp_path: Path, name: str, text: str, kind: str) -> None:
    (tmp_path / name).write_text(text)
    assert reader_of(tmp_path / name).kind == kind


@pytest.mark.parametrize(("name", "ending"), [("a.mp4", ".mp4"), ("take", "nothing")])
def test_a_file_that_nobody_reads_names_what_there_is(name: str, ending: str) -> None:
    with pytest.raises(TakeError, match=f"{name}: not a take: its name ends in {ending}") as caught:
        reader_of(Path(name))
    assert caught.value.hint.startswith("use .") and " or ." in caught.value.hint
    assert all(suffix in caught.value.hint for suffix in suffixes())


def test_a_reader_of_another_package_reads(install: Callable[..., None]) -> None:
    install("track", ".track", ".trk")
    take = load_take(Path("a.TRK"), P)
    assert take.frames == 2 and not np.any(take.values) and ".track" in suffixes()
    assert reader_of(Path("a.track")).layer == "capture"


@pytest.mark.parametrize(
    ("suffix", "why"),
    [("track", "begin with a dot"), (".Track", "lower case"), (".wav", "is read by the built-in kind 'wav'")],
)
def test_wrong_suffixes_are_refused(install: Callable[..., None], suffix: str, why: str) -> None:
    install("track", suffix)
    with pytest.raises(PluginError, match=why):
        TAKES.get("track")


def test_a_reader_of_another_package_shares_a_suffix_with_what_it_recognises(
    install: Callable[..., None], tmp_path: Path
) -> None:
    install("track", ".csv", ".track", recognises="plugin_track:mine")
    install("other", ".track", recognises="plugin_other:mine")
    for name, text, kind in (("a.csv", "mine", "track"), ("b.csv", "time,jawOpen", "plain")):
        (tmp_path / name).write_text(text)
        assert reader_of(tmp_path / name).kind == kind
    (tmp_path / "a.track").write_text("nobody's")
    with pytest.raises(TakeError, match="that omote knows") as caught:
        reader_of(tmp_path / "a.track")
    assert "trial" in caught.value.hint


def test_a_reader_for_another_version_is_refused(install: Callable[..., None]) -> None:
    install("track", ".track", api=API + 1)
    with pytest.raises(PluginError, match="track-package"):
        TAKES.get("track")


def test_what_is_no_take_is_refused_and_errors_name_the_package(install: Callable[..., None]) -> None:
    install("three", ".three", read="nothing")
    with pytest.raises(TakeError, match="take kind 'three' gave no take, but 3") as caught:
        load_take(Path("a.three"), P)
    assert caught.value.hint
    install("zero", ".zero", read="broken")
    TAKES.clear()
    with pytest.raises(PluginError, match="zero"):
        load_take(Path("a.zero"), P)


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(TakeReader).anything = 1
