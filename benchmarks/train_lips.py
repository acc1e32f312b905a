# ruff: noqa: T201
"""Learns the network that shapes lips by the sound of a voice (``controller/takes/voices/lips.npz``).

    python benchmarks/train_lips.py FOLDER -o lips.npz [--rounds 60] [--hidden 32]

FOLDER holds recordings NAME.wav, each with an alignment of its sounds NAME.TextGrid, as ``voice_shapes.py`` reads
them; keep others apart to measure what was learnt. The shipped network was learnt so from 28 minutes that flite spoke
(four voices) and 13 that espeak-ng spoke (English and six more languages). Every fourth round hears the recordings as
other microphones, rooms and voices would give them. The optimizer is Adam (Kingma and Ba 2015), the loss cross entropy
with rare visemes counted more; closed lips count most, since a mouth that misses them is seen at once.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from controller.base.parameters import PARAMETERS, Floats
from controller.takes.aligned import sounds_of
from controller.takes.voices import lips
from controller.takes.voices.pcm import open_sound
from controller.vocabulary.visemes import Visemes

MOST_S = 3600
"""Seconds of a recording that are read."""
BATCH = 512
RENEW = 4
"""Rounds after which recordings are changed again."""
CLOSED = 1.8
"""How much more closed lips count."""
LOUD_PERCENTILE = 95
SCALE = 256.0


@dataclass
class Speech:
    """One recording: ``levels`` (k, BANDS) dB, and ``spoken`` (k,) the viseme of each frame."""

    levels: Floats
    spoken: np.ndarray


def read_speech(sound: Path, visemes: Visemes) -> Speech:
    """A recording with its alignment; what is not named is silence."""
    with sound.open("rb") as stream:
        wav = open_sound(stream, str(sound))
        samples, rate = wav.format.samples(wav.read(MOST_S * wav.format.rate_hz)), wav.format.rate_hz
    size = round(lips.WINDOW_S * rate)
    starts = np.arange(0, len(samples) - size, round(lips.HOP_S * rate))
    levels = lips.band_levels(samples[starts[:, None] + np.arange(size)], rate)
    middle_s = (starts + size / 2) / rate
    spoken = np.full(len(starts), visemes.names.index("sil"))
    for start_s, end_s, _, weights in sounds_of(sound.with_suffix(".TextGrid"), visemes):
        spoken[(middle_s >= start_s) & (middle_s < end_s)] = int(weights.argmax())
    return Speech(levels, spoken)


def heard_elsewhere(levels: Floats, draw: np.random.Generator) -> Floats:
    """The recording as another voice, microphone and room would give it: pitch of formants, tilt, echo, noise."""
    n = levels.shape[1]
    bands = np.arange(n)
    at = np.clip(bands * (1 + draw.uniform(-0.05, 0.05)) + draw.uniform(-2, 2), 0, n - 1)
    low = np.minimum(at.astype(int), n - 2)
    moved = levels[:, low] * (low + 1 - at) + levels[:, low + 1] * (at - low)
    bumps = 1.5 * np.convolve(draw.normal(0, 3, n + 4), np.full(5, 0.2), "valid")
    moved = moved + draw.uniform(-14, 14) * (bands / n - 0.4) + bumps
    loud = np.percentile(lips.loudness_db(moved), LOUD_PERCENTILE)
    if draw.random() < 0.6:
        moved = _echo(moved, draw)
    floor = loud - draw.uniform(35, 80) + draw.uniform(-10, 0) * (bands / n)
    noise = 10 ** (floor / 10) * (draw.exponential(1, moved.shape) + 1e-3)
    moved = 10 * np.log10(10 ** (moved / 10) + noise)
    if draw.random() < 0.12:  # a line that carries no high frequencies
        moved[:, -int(draw.integers(4, 8)) :] = -140.0
    return np.asarray(moved, dtype=np.float64)


def _echo(levels: Floats, draw: np.random.Generator) -> Floats:
    """With what a room of a reverberation time of 0.08 to 0.6 s adds."""
    power = 10 ** (levels / 10)
    keep, share = 10 ** (-6 * lips.HOP_S / draw.uniform(0.08, 0.6)), 10 ** (-draw.uniform(3, 14) / 10)
    tail, added = np.zeros(power.shape[1]), np.empty_like(power)
    for k, now in enumerate(power):
        added[k] = tail
        tail = (tail + now * (1 - keep)) * keep
    return np.asarray(10 * np.log10(power + share * added * draw.uniform(0.6, 1.4, power.shape[1]) + 1e-14))


def examples(speech: list[Speech], draw: np.random.Generator | None) -> tuple[Floats, np.ndarray]:
    """Features (k, INPUTS) of all frames and their visemes (k,); changed by chance where ``draw`` is given."""
    silence = np.full((1, lips.BANDS), -140.0)
    rows = []
    for each in speech:
        levels = each.levels if draw is None else heard_elsewhere(each.levels, draw)
        loud = np.percentile(lips.loudness_db(levels), LOUD_PERCENTILE)
        loud += 0.0 if draw is None else draw.uniform(-3, 5)
        padded = np.concatenate([silence.repeat(lips.BEFORE, 0), levels, silence.repeat(lips.AHEAD, 0)])
        rows.append(lips.features(padded, loud))
    return np.concatenate(rows), np.concatenate([each.spoken for each in speech])


@dataclass
class Adam:
    """Adapts weights by their gradients; ``decay`` : how fast weights without use shrink."""

    weights: list[Floats]
    decay: float = 2e-5
    step: int = 0
    mean: list[Floats] = field(default_factory=list)
    square: list[Floats] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.mean, self.square = ([np.zeros_like(w) for w in self.weights] for _ in range(2))

    def adapt(self, gradients: list[Floats], rate: float) -> None:
        """One step at a learning rate."""
        self.step += 1
        for w, g, mean, square in zip(self.weights, gradients, self.mean, self.square, strict=True):
            g = g + self.decay * w
            mean += 0.1 * (g - mean)
            square += 0.001 * (g * g - square)
            w -= rate * (mean / (1 - 0.9**self.step)) / (np.sqrt(square / (1 - 0.999**self.step)) + 1e-8)


def gradients(weights: list[Floats], x: Floats, spoken: np.ndarray, counts: Floats) -> list[Floats]:
    """Of the weighted cross entropy of a batch (k, INPUTS)."""
    hidden, out = weights
    inner = np.tanh(x @ hidden[:-1] + hidden[-1])
    score = inner @ out[:-1] + out[-1]
    share = np.exp(score - score.max(axis=1, keepdims=True))
    share /= share.sum(axis=1, keepdims=True)
    share[np.arange(len(x)), spoken] -= 1
    share *= counts[spoken][:, None] / len(x)
    back = (share @ out[:-1].T) * (1 - inner * inner)
    return [np.vstack([x.T @ back, back.sum(0)]), np.vstack([inner.T @ share, share.sum(0)])]


def train(speech: list[Speech], visemes: Visemes, rounds: int, hidden: int, seed: int = 0) -> Iterator[list[Floats]]:
    """Learn; gives the weights after each round: (INPUTS + 1, hidden) and (hidden + 1, visemes)."""
    draw, n = np.random.default_rng(seed), len(visemes.names)
    weights = [
        draw.normal(0, 1 / np.sqrt(lips.INPUTS), (lips.INPUTS + 1, hidden)),
        draw.normal(0, 0.3 / np.sqrt(hidden), (hidden + 1, n)),
    ]
    adam = Adam(weights)
    for turn in range(rounds):
        if turn % RENEW == 0:
            x, spoken = examples(speech, draw)
            often = np.bincount(spoken, minlength=n)
            counts = np.sqrt(often.mean() / np.maximum(often, 1))
            counts[visemes.names.index("PP")] *= CLOSED
        rate = 3e-3 * 0.5 * (1 + np.cos(np.pi * turn / rounds)) + 1e-5
        order = draw.permutation(len(x))
        for first in range(0, len(x), BATCH):
            some = order[first : first + BATCH]
            adam.adapt(gradients(weights, x[some], spoken[some], counts), rate)
        yield weights


def write(path: Path, weights: list[Floats], visemes: Visemes) -> None:
    """Write the network with 16 bits a weight."""
    hidden, out = (np.rint(w * SCALE).clip(-32767, 32767).astype(np.int16) for w in weights)
    np.savez_compressed(path, visemes=np.array(visemes.names), hidden=hidden, out=out)


def main() -> None:
    """Learn from a folder, and print the share of frames that are judged right as it goes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--out", type=Path, default=Path("lips.npz"))
    parser.add_argument("--rounds", type=int, default=60)
    parser.add_argument("--hidden", type=int, default=32)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    visemes = Visemes.load(PARAMETERS)
    sounds = [path for path in sorted(given.folder.glob("*.wav")) if path.with_suffix(".TextGrid").exists()]
    if not sounds:
        raise SystemExit(f"{given.folder}: no NAME.wav with a NAME.TextGrid of sounds")
    speech = [read_speech(path, visemes) for path in sounds]
    plain, spoken = examples(speech, None)
    for turn, weights in enumerate(train(speech, visemes, given.rounds, given.hidden, given.seed), 1):
        if turn % 10 == 0 or turn == given.rounds:
            judged = lips.LipModel(visemes.names, *weights).classify(plain).argmax(axis=1)
            print(f"round {turn}: {(judged == spoken).mean():.2f} of {len(spoken)} frames", flush=True)
    write(given.out, weights, visemes)
    print(f"wrote {given.out}")


if __name__ == "__main__":
    main()
