"""Speech as takes."""

from __future__ import annotations

import json
import wave
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest

from controller.base.errors import TakeError
from controller.base.parameters import PARAMETERS as P
from controller.layers.commands import CommandState
from controller.takes.livelink import TakePlayer
from controller.takes.reader import load_take
from controller.takes.speech import Cue, cue_take, speech_take
from controller.vocabulary.visemes import Visemes
from tests.controller.takes.voices.synthesis import MEN, noise, vowel

VISEMES = Visemes.load(P)
JAW, PRESS, SMILE = P.index("jawOpen"), P.index("mouthPressLeft"), P.index("mouthSmileLeft")


def say(*sounds: tuple[float, str], end_s: float) -> np.ndarray:
    cues = [Cue(start, VISEMES.weights(name)) for start, name in sounds]
    return speech_take("test", cues, end_s, P, VISEMES).values


def test_a_held_sound_shows_its_shape_and_the_mouth_closes_after() -> None:
    values = say((0.0, "sil"), (0.5, "aa"), (1.5, "sil"), end_s=2.0)
    assert values[100, JAW] == pytest.approx(0.55)
    assert values[0, JAW] == 0.0 and values[-1, JAW] == 0.0


def test_lips_meet_for_a_short_p_between_open_vowels() -> None:
    values = say((0.0, "aa"), (0.30, "PP"), (0.37, "aa"), end_s=0.7)
    full = VISEMES.matrix[PRESS, 1]
    assert values[30:38, PRESS].max() > 0.85 * full
    assert values[30:38, JAW].min() < 0.1
    assert values[20, JAW] > 0.5


def test_sounds_reach_into_their_neighbours_without_jumps() -> None:
    values = say((0.0, "sil"), (0.3, "O"), (0.45, "nn"), (0.55, "I"), (0.75, "SS"), (0.9, "sil"), end_s=1.1)
    pucker = values[:, P.index("mouthPucker")]
    assert pucker[28] > 0.05  # before the O begins
    assert np.abs(np.diff(values, axis=0)).max() < 0.25
    assert np.all((values >= 0) & (values <= 1))


def step(away: np.ndarray) -> np.ndarray:
    """Perlin's step of the fifth degree, from 1 to 0."""
    x = 1.0 - np.clip(away, 0.0, 1.0)
    return x**3 * (6.0 * x**2 - 15.0 * x + 10.0)


def test_a_sound_alone_rises_120_ms_before_and_falls_in_80_ms_after() -> None:
    values = say((0.5, "aa"), end_s=1.0)[:, JAW]
    assert len(values) == 109, "until the mouth is closed again, at 100 rows a second"
    time = np.arange(len(values)) / 100.0
    assert time[-1] == pytest.approx(1.08, abs=0.011)  # until the mouth is closed
    full = min(float(VISEMES.matrix[JAW] @ VISEMES.weights("aa")), 1.0)
    away = np.maximum((0.5 - time) / 0.12, (time - 1.0) / 0.08)
    np.testing.assert_allclose(values, full * step(away), atol=1e-9)


def test_neighbours_share_a_moment_by_their_dominance_the_less_the_firmer_the_sound_there_holds() -> None:
    names, starts, ends = ("aa", "PP", "O"), (0.2, 0.6, 0.7), (0.6, 0.7, 1.1)
    values = say(*zip(starts, names, strict=True), end_s=1.1)
    weights = np.stack([VISEMES.weights(name) for name in names])
    hold = weights @ VISEMES.hold
    for row in (30, 55, 59, 62, 65, 69, 72, 80):
        time = row / 100.0
        here = sum(time >= start - 1e-9 for start in starts) - 1
        room = 1.0 - 0.85 * hold[here]
        away = [max((a - time) / (0.12 * room), (time - b) / (0.08 * room)) for a, b in zip(starts, ends, strict=True)]
        share = step(np.array(away)) * (0.2 + 0.8 * hold)
        wanted = np.minimum(VISEMES.matrix @ (share / share.sum() @ weights), 1.0)
        np.testing.assert_allclose(values[row], wanted, atol=1e-9)


@pytest.mark.parametrize(
    ("starts", "end_s", "why"),
    [
        ((), 1.0, "at least one sound"), ((0.5, 0.4), 1.0, "ascending times"), ((0.5,), 0.4, "ascending times"),
        ((-0.1,), 1.0, "0 to 3600 s"), ((0.0,), 3600.1, "0 to 3600 s"), ((0.5, 0.5), 0.5, ""), ((0.0,), 3600.0, ""),
    ],
)  # fmt: skip
def test_times_of_sounds_rise_within_an_hour(starts: tuple[float, ...], end_s: float, why: str) -> None:
    if not why:
        assert say(*((at, "aa") for at in starts), end_s=end_s).max() > 0.3
        return
    with pytest.raises(TakeError, match=why):
        say(*((at, "aa") for at in starts), end_s=end_s)


def test_rhubarb_tsv_and_json_agree(tmp_path: Path) -> None:
    shapes = [(0.00, "X"), (0.05, "D"), (0.27, "C"), (0.31, "B"), (0.43, "X")]
    ends = [t for t, _ in shapes[1:]] + [0.47]
    tsv, js = tmp_path / "hi.tsv", tmp_path / "hi.json"
    tsv.write_text("".join(f"{t:.2f}\t{shape}\n" for t, shape in [*shapes, (0.47, "X")]))
    cues = [{"start": t, "end": e, "value": s} for (t, s), e in zip(shapes, ends, strict=True)]
    js.write_text(json.dumps({"metadata": {"duration": 0.47}, "mouthCues": cues}))
    one, other = load_take(tsv, P), load_take(js, P)
    assert one.sample(0.16, P.neutral())[JAW] > 0.45
    n = min(one.frames, other.frames) - 20
    np.testing.assert_allclose(one.values[:n], other.values[:n], atol=1e-9)


def test_phonemes_a_line(tmp_path: Path) -> None:
    path = tmp_path / "word.tsv"
    path.write_text("# mama\n0.0 SIL\n0.2 M\n0.3 AA1\n0.5 M\n0.6 AA0\n0.8 SIL\n")
    take = load_take(path, P)
    jaw = take.values[:, JAW]
    assert jaw[40] > 0.4 and jaw[25] < 0.1 and jaw[55] < 0.15 and jaw[70] > 0.4


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.tsv", "0.0 X\nzero D\n", "line 2: 'zero D' is not a time"),
        ("a.tsv", "0.0 AA\n0.2 QQ\n", "line 2: unknown viseme or phoneme 'QQ'"),
        ("a.tsv", "0.5 X\n0.2 D\n", "ascending times"),
        ("a.tsv", "", "at least one sound"),
        ("a.json", "{}", "not the output of rhubarb"),
        ("a.json", "[", "not the output of rhubarb"),
        ("a.json", '{"mouthCues": 5}', "there is no list mouthCues"),
        ("a.json", '{"mouthCues": [5]}', "mouthCues[0] must be a table"),
        ("a.json", '{"mouthCues": [{"start": null, "end": 1, "value": "A"}]}', "mouthCues[0].start must be a time"),
        ("a.json", f'{{"mouthCues": [{{"start": 0, "end": {10**400}, "value": "A"}}]}}', "mouthCues[0].end must be a"),
        ("a.json", '{"mouthCues": [{"start": 0, "end": 1, "value": ["A"]}]}', "mouthCues[0].value must be a name"),
        ("a.wav", "RIFF", "not WAV of PCM"),
        ("a.mp4", "", "its name ends in .mp4"),
    ],
)
def test_broken_files_say_why(tmp_path: Path, name: str, text: str, message: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(TakeError) as caught:
        load_take(path, P)
    assert message in str(caught.value) and caught.value.hint


def test_missing_files(tmp_path: Path) -> None:
    for name in ("a.tsv", "a.wav", "a.csv"):
        with pytest.raises(TakeError):
            load_take(tmp_path / name, P)


def write_wav(path: Path, sound: np.ndarray, rate: int, width: int = 2, channels: int = 1) -> Path:
    kinds = {1: ("u1", 127, 128), 2: ("<i2", 32767, 0), 4: ("<i4", 2**31 - 1, 0)}
    kind, scale, offset = kinds[width]
    with wave.open(str(path), "wb") as file:
        file.setnchannels(channels)
        file.setsampwidth(width)
        file.setframerate(rate)
        file.writeframes(np.repeat(sound * scale + offset, channels).astype(kind).tobytes())
    return path


@pytest.mark.parametrize(("width", "channels", "rate"), [(2, 1, 16000), (1, 1, 8000), (4, 2, 44100)])
def test_a_voice_opens_the_jaw_and_silence_closes_it(tmp_path: Path, width: int, channels: int, rate: int) -> None:
    voice = np.zeros(2 * rate)
    voice[rate // 2 : rate // 2 + int(0.7 * rate)] = vowel(MEN["ɑ"], 120.0, 0.7, rate)
    take = load_take(write_wav(tmp_path / "a.wav", voice, rate, width, channels), P)
    jaw = take.values[:, JAW]
    assert take.frames == 200 and take.duration_s == pytest.approx(1.99)
    assert jaw[80:110].min() > 0.3 and jaw[:45].max() < 0.02 and jaw[170:].max() < 0.05


def test_hissing_stretches_the_lips_more_than_it_opens_the_jaw(tmp_path: Path) -> None:
    voice, silence = vowel(MEN["ɑ"], 120.0, 0.8), np.zeros(3200)
    sound = np.concatenate([voice, silence, noise(4500, 7800, 0.4, 0.06), silence])
    values = load_take(write_wav(tmp_path / "a.wav", sound, 16000), P).values
    stretch = P.index("mouthStretchLeft")
    assert values[105:135, stretch].min() > 0.1 > values[105:135, JAW].max()
    assert values[20:70, JAW].min() > 0.3


def test_symbols_of_the_ipa_are_sounds_too(tmp_path: Path) -> None:
    sounds = {"ipa": "m ˈaɪ ʃ yː _", "arpabet": "M AY1 SH UW0 SIL"}
    for name, words in sounds.items():
        text = "".join(f"{0.2 * i:.1f} {word}\n" for i, word in enumerate(words.split()))
        (tmp_path / f"{name}.tsv").write_text(text, encoding="utf-8")
    ipa, arpabet = (load_take(tmp_path / f"{name}.tsv", P) for name in ("ipa", "arpabet"))
    np.testing.assert_allclose(ipa.values, arpabet.values)
    (tmp_path / "bad.tsv").write_text("0 ʃ\n0.1 ✂\n", encoding="utf-8")
    with pytest.raises(TakeError, match="line 2: unknown viseme or phoneme"):
        load_take(tmp_path / "bad.tsv", P)


def test_talking_keeps_the_smile_and_the_brows(tmp_path: Path) -> None:
    state, out, now = CommandState(P), P.neutral(), 10**9
    state.expression("happiness", 1.0, None, now)
    path = tmp_path / "a.tsv"
    path.write_text("0 SIL\n1 AA\n3 SIL\n")
    player = TakePlayer(load_take(path, P), state, "speech")
    shown = []
    for _ in range(250):
        now += 10_000_000
        player.tick(now)
        state.tick(now, 0.01, out)
        shown.append(out.copy())
    talking = shown[220]
    assert talking[JAW] == pytest.approx(0.55, abs=0.02)
    assert talking[SMILE] > 0.4 and talking[P.index("cheekSquintLeft")] == pytest.approx(0.9, abs=0.01)
    assert state.holder(JAW) == "speech" and state.holder(P.index("browInnerUp")) == "expression"


def test_a_record_cannot_be_changed() -> None:
    with pytest.raises(FrozenInstanceError):
        object.__new__(Cue).anything = 1


@pytest.mark.parametrize("text", ["0.0\tA\n1e12\tB\n", "0.0\tA\n3600.5\tX\n"])
def test_times_of_more_than_an_hour_are_refused_before_anything_is_made(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.tsv").write_text(text)
    with pytest.raises(TakeError, match="0 to 3600 s are read"):
        cue_take(tmp_path / "a.tsv", P)


@pytest.mark.parametrize("end", ["1e15", "NaN", "Infinity", "-1", "1e999"])
def test_an_end_no_sound_has_is_refused(tmp_path: Path, end: str) -> None:
    (tmp_path / "a.json").write_text(f'{{"mouthCues": [{{"start": 0, "end": {end}, "value": "A"}}]}}')
    with pytest.raises(TakeError):
        cue_take(tmp_path / "a.json", P)
