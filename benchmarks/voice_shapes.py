# ruff: noqa: T201
"""How often a mouth that follows a voice shows the class of the sound that is spoken.

    python benchmarks/voice_shapes.py FOLDER

FOLDER holds recordings NAME.wav, each with an alignment of its sounds NAME.TextGrid. Every frame of 10 ms counts in
which one of the sounds of CLASSES is spoken; silence and weak vowels are left out.
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import numpy as np

from controller.base.parameters import PARAMETERS, Floats
from controller.takes.aligned import sounds_of
from controller.takes.voice import wav_take
from controller.vocabulary.visemes import Visemes

CLASSES = {
    "closed": "PP sil", "open": "aa E kk", "round": "O U RR", "spread": "I", "fricative": "FF TH SS CH",
    "narrow": "nn DD",
}  # fmt: skip
"""Visemes that look alike. A sound of the last class, or kk, RR or silence, is not counted; showing one is an error."""
COUNTED = {"PP", "FF", "TH", "SS", "CH", "aa", "E", "I", "O", "U"}
WEAK = {"AX", "AH0", "ə", "ɐ"}
_CLASS_OF = {viseme: name for name, visemes in CLASSES.items() for viseme in visemes.split()}


def looks(values: Floats) -> Floats:
    """(..., 5) how far a mouth is open, pressed, round, wide and bares its teeth."""
    features = (
        {"jawOpen": 1.0}, {"mouthRollLower": 0.5, "mouthRollUpper": 0.5, "mouthPressLeft": 0.5},
        {"mouthPucker": 0.7, "mouthFunnel": 0.7}, {"mouthStretchLeft": 1.0, "mouthSmileLeft": 0.7},
        {"mouthLowerDownLeft": 0.7, "mouthUpperUpLeft": 0.7},
    )  # fmt: skip
    columns = [sum(share * values[..., PARAMETERS.index(name)] for name, share in each.items()) for each in features]
    return np.stack(columns, axis=-1)


def shown_classes(values: Floats, visemes: Visemes) -> list[str]:
    """The class of the viseme that each row (n, P) looks most like."""
    apart = np.linalg.norm(looks(values)[:, None] - looks(visemes.matrix.T)[None], axis=-1)
    return [_CLASS_OF[visemes.names[i]] for i in apart.argmin(axis=1)]


def count(sound: Path, visemes: Visemes) -> tuple[Counter[str], Counter[str]]:
    """Frames that show the class of their sound, and all frames that count, by class."""
    take, right, total = wav_take(sound, PARAMETERS), Counter[str](), Counter[str]()
    shown = shown_classes(take.values, visemes)
    for start_s, end_s, text, weights in sounds_of(sound.with_suffix(".TextGrid"), visemes):
        viseme = visemes.names[int(weights.argmax())]
        if viseme in COUNTED and text.upper() not in WEAK and text not in WEAK:
            frames = np.flatnonzero((take.times_s >= start_s) & (take.times_s < end_s))
            total[_CLASS_OF[viseme]] += len(frames)
            right[_CLASS_OF[viseme]] += sum(shown[i] == _CLASS_OF[viseme] for i in frames)
    return right, total


def main() -> None:
    """Print a table of all recordings of a folder together."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    visemes, right, total = Visemes.load(PARAMETERS), Counter[str](), Counter[str]()
    pairs = [path for path in sorted(folder.glob("*.wav")) if path.with_suffix(".TextGrid").exists()]
    for path in pairs:
        shown, spoken = count(path, visemes)
        right, total = right + shown, total + spoken
    if not total:
        raise SystemExit(f"{folder}: no NAME.wav with a NAME.TextGrid of sounds")
    shares = {name: right[name] / total[name] for name in CLASSES if total[name]}
    for name, share in shares.items():
        print(f"{name:10} {share:.2f} of {total[name]} frames")
    print(f"{'mean':10} {np.mean([*shares.values()]):.2f}, all frames {right.total() / total.total():.2f}")


if __name__ == "__main__":
    main()
