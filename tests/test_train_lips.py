"""benchmarks/train_lips.py: it learns what it hears, from recordings with alignments, and writes what omote reads."""

from __future__ import annotations

import sys
import wave
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS
from controller.takes.voices import lips
from controller.vocabulary.visemes import Visemes
from tests.controller.takes.voices.synthesis import MEN, RATE, WOMEN, noise, vowel

SOUNDS = {"ɑ": "aa", "i": "I", "u": "U", "s": "SS", "m": "PP"}
LENGTH_S = 0.25


@pytest.fixture(scope="module")
def program(root: Path) -> ModuleType:
    spec = spec_from_file_location("train_lips", root / "benchmarks" / "train_lips.py")
    assert spec is not None and spec.loader is not None
    module = sys.modules[spec.name] = module_from_spec(spec)  # its dataclasses look there for their module
    spec.loader.exec_module(module)
    return module


def spoken(symbol: str, formants: dict[str, tuple[int, int, int]], pitch_hz: float) -> np.ndarray:
    """A sound that lasts a quarter of a second: m hums through closed lips, s hisses."""
    if symbol == "s":
        return noise(4500, 7500, LENGTH_S, 0.1)
    if symbol == "m":
        return 0.2 * vowel((250, 1100, 2200), pitch_hz, LENGTH_S)
    return vowel(formants[symbol], pitch_hz, LENGTH_S)


def record(path: Path, symbols: list[str], formants: dict[str, tuple[int, int, int]], pitch_hz: float) -> None:
    """A WAV file and its TextGrid."""
    sound = np.concatenate([spoken(symbol, formants, pitch_hz) for symbol in symbols])
    with wave.open(str(path), "wb") as file:
        file.setparams((1, 2, RATE, 0, "NONE", ""))
        file.writeframes((20_000 * sound).clip(-32767, 32767).astype("<i2").tobytes())
    lines = ['File type = "ooTextFile"', 'Object class = "TextGrid"', "", "0", f"{LENGTH_S * len(symbols)}", "<exists>",
             "1", '"IntervalTier"', '"phones"', "0", f"{LENGTH_S * len(symbols)}", f"{len(symbols)}"]  # fmt: skip
    for k, symbol in enumerate(symbols):
        lines += [f"{k * LENGTH_S}", f"{(k + 1) * LENGTH_S}", f'"{symbol}"']
    path.with_suffix(".TextGrid").write_text("\n".join(lines) + "\n", encoding="utf-8")


def test_it_learns_from_one_voice_what_another_says(program: ModuleType, tmp_path: Path) -> None:
    draw, visemes = np.random.default_rng(1), Visemes.load(PARAMETERS)
    for k in range(6):
        formants, pitch_hz = ((MEN, 100), (WOMEN, 200))[k % 2]
        record(tmp_path / f"heard{k}.wav", list(draw.permutation(list(SOUNDS))), formants, pitch_hz + 8 * k)
    record(tmp_path / "another.wav", list(SOUNDS), MEN, 160)
    speech = [program.read_speech(path, visemes) for path in sorted(tmp_path.glob("heard*.wav"))]
    assert {visemes.names[i] for i in np.concatenate([s.spoken for s in speech])} == set(SOUNDS.values())
    *_, weights = program.train(speech, visemes, rounds=120, hidden=12)
    heard, said = program.examples([program.read_speech(tmp_path / "another.wav", visemes)], None)
    judged = lips.LipModel(visemes.names, *weights).classify(heard).argmax(axis=1)
    assert (judged == said).mean() > 0.7, "by chance it would be 0.2"
    program.write(tmp_path / "lips.npz", weights, visemes)
    with np.load(tmp_path / "lips.npz") as file:
        assert np.abs(file["hidden"] / program.SCALE - weights[0]).max() < 0.002
        assert file["out"].shape == weights[1].shape and tuple(file["visemes"]) == visemes.names


def test_its_gradients_are_those_of_its_loss(program: ModuleType) -> None:
    """Against differences of the loss, which is written here once more from its definition."""
    draw = np.random.default_rng(2)
    weights = [draw.normal(0, 0.3, (7, 4)), draw.normal(0, 0.3, (5, 3))]
    x, spoken_, counts = draw.normal(size=(10, 6)), draw.integers(0, 3, 10), np.array([1.0, 2.0, 0.5])

    def loss() -> float:
        score = np.tanh(x @ weights[0][:-1] + weights[0][-1]) @ weights[1][:-1] + weights[1][-1]
        log_share = score - np.log(np.exp(score).sum(axis=1, keepdims=True))
        return float(-(counts[spoken_] * log_share[np.arange(10), spoken_]).mean())

    found = program.gradients(weights, x, spoken_, counts)
    for w, g in zip(weights, found, strict=True):
        for at in ((0, 0), (2, 1), (-1, 2)):
            kept = w[at]
            w[at] = kept + 1e-5
            high = loss()
            w[at] = kept - 1e-5
            low = loss()
            w[at] = kept
            assert g[at] == pytest.approx((high - low) / 2e-5, abs=1e-6)
