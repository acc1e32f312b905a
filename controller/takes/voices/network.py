"""Computes faces from a voice with a neural network that the user provides as an ONNX file (the extra onnx).

The network's first input takes samples of a voice, float32 in -1..1, of shape (n,) or (1, n); n may be fixed. Its first
output has k parameters in its last dimension: (..., t, k) for t moments of the piece of sound, or (k,) or (1, k) for
the piece's middle. Metadata of the model may contain ``sample_rate`` (default: 16000), ``fps`` (default: 30; only for a
network with one moment per piece) and ``names`` of the parameters, separated by commas (default: the order of ``LIST
PARAMETERS``). Further inputs get zeros.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from controller.base.errors import TakeError
from controller.base.parameters import Floats, Indices, Parameters
from controller.takes.livelink import Take
from controller.takes.voices.pcm import open_sound
from surface.base import files
from surface.base.extras import importing

_RATE_HZ, _FPS = 16_000, 30.0
_PIECE_S, _MAX_SOUND_S = 20.0, 3600.0
_TAPS = 32  # of the low-pass filter, on each side, in samples of the slower rate
_HINT = "the page on expression in the docs of omote says what a network that makes faces of voices must be like"


def network_take(path: Path, model: Path, parameters: Parameters) -> Take:
    """Return a take of a WAV file by a network.

    Raises TakeError: the sound or the model cannot be read, or the model is unsuitable. MissingPackage: onnxruntime is
    not installed.
    """
    network = Network(model, parameters)
    with files.reading(path, TakeError), files.open_file(path) as stream:
        sound = open_sound(stream, str(path))
        samples = sound.format.samples(sound.read(int(_MAX_SOUND_S * sound.format.rate_hz)))
    if not len(samples):
        raise TakeError(f"{path}: no sound in it", hint="record it again")
    times, values = network.faces(resample(samples, sound.format.rate_hz, network.rate_hz))
    mask = np.zeros(len(parameters), dtype=bool)
    mask[network.indices] = True
    return Take(path.name, times, values, mask, parameters.low, parameters.high)


@dataclass(frozen=True)
class _Input:
    """An input besides the voice, and the zeros that fill it."""

    name: str
    zeros: np.ndarray


class Network:
    """A network that is ready to run.

    Attributes
    ----------
    rate_hz : of the samples that it takes. indices : (k',) indices of the parameters that it outputs.

    Raises TakeError, MissingPackage: see :func:`network_take`.
    """

    def __init__(self, path: Path, parameters: Parameters) -> None:
        with importing("a network that makes faces of voices", "onnxruntime"):
            import onnxruntime  # optional: the extra onnx
        with files.reading(path, TakeError):
            content = files.read_file(path)
        try:
            self._session: Any = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
        except Exception as error:  # the package's own tree of errors, whose base is Exception
            why = str(error).splitlines()[0][:200]
            raise TakeError(f"{path}: not an ONNX network: {why}", hint=_HINT) from error
        self._path, self._parameters = path, parameters
        metadata = self._session.get_modelmeta().custom_metadata_map
        self.rate_hz = round(self._number(metadata, "sample_rate", _RATE_HZ, 4000, 192_000))
        self._fps = self._number(metadata, "fps", _FPS, 1, 240)
        voice, *others = self._session.get_inputs()
        self._voice, self._rank = voice.name, len(voice.shape)
        self._size = voice.shape[-1] if voice.shape and isinstance(voice.shape[-1], int) else None
        if self._rank not in (1, 2) or voice.type != "tensor(float)":
            raise self._unfit(f"its first input is {voice.type} of {self._rank} dimensions, not samples of a voice")
        self._others = [_zero_input(each) for each in others]
        self._columns, self.indices = self._outputs(metadata.get("names"))

    def faces(self, samples: Floats) -> tuple[Floats, Floats]:
        """Return times (n,) s and values (n, P) for samples (k,) of a voice. Raises TakeError: the network fails."""
        if self._single:
            return self._slide(samples)
        size = self._size or round(_PIECE_S * self.rate_hz)
        pieces = [samples[begin : begin + size] for begin in range(0, len(samples), size)]
        times, rows = [], []
        for n, piece in enumerate(pieces):
            given = np.pad(piece, (0, size - len(piece))) if self._size else piece
            found = self._run(given)
            kept = max(1, math.ceil(len(found) * len(piece) / len(given)))
            times.append((n * size + (np.arange(kept) + 0.5) * len(given) / len(found)) / self.rate_hz)
            rows.append(found[:kept])
        times_s = np.concatenate(times)
        return times_s - times_s[0], self._values(np.concatenate(rows))

    def _slide(self, samples: Floats) -> tuple[Floats, Floats]:
        """Run a network that outputs one moment, the middle, for windows that overlap."""
        size = self._size or round(0.5 * self.rate_hz)
        times = np.arange(max(1, int(len(samples) / self.rate_hz * self._fps))) / self._fps
        padded = np.pad(samples, (size // 2, size))
        begins = (times * self.rate_hz).astype(int)
        return times, self._values(np.concatenate([self._run(padded[b : b + size]) for b in begins]))

    def _run(self, samples: Floats) -> Floats:
        """Return the network's output (t, k) for samples (n,)."""
        given = samples.astype(np.float32).reshape((1, -1) if self._rank == 2 else (-1,))
        try:
            first, *_ = self._session.run(
                None, {self._voice: given, **{each.name: each.zeros for each in self._others}}
            )
        except Exception as error:  # the package's own tree of errors, whose base is Exception
            raise self._unfit(f"it fails: {str(error).splitlines()[0][:200]}") from error
        found = np.asarray(first, dtype=np.float64)
        rows: Floats = np.nan_to_num(found.reshape(-1, found.shape[-1]))
        return rows

    def _outputs(self, names: str | None) -> tuple[Indices, Indices]:
        """Return the columns of the output that are parameters, and the indices of these parameters."""
        probe = self._run(np.zeros(self._size or self.rate_hz))
        self._single = len(probe) == 1
        listed = (
            [name.strip() for name in names.split(",")] if names else list(self._parameters.names[: probe.shape[1]])
        )
        if len(listed) != probe.shape[1]:
            raise self._unfit(f"it gives {probe.shape[1]} values, and has {len(listed)} names for them")
        pairs = [(column, self._parameters.find(name)) for column, name in enumerate(listed)]
        known = [(column, index) for column, index in pairs if index is not None]
        if not known:
            raise self._unfit("none of its names is a parameter")
        columns, indices = zip(*known, strict=True)
        return np.array(columns), np.array(indices)

    def _values(self, rows: Floats) -> Floats:
        values = np.zeros((len(rows), len(self._parameters)))
        values[:, self.indices] = rows[:, self._columns]
        return np.clip(values, self._parameters.low, self._parameters.high)

    def _number(self, metadata: dict[str, str], key: str, usual: float, least: float, most: float) -> float:
        try:
            value = float(metadata.get(key, usual))
        except ValueError:
            value = math.nan
        if not least <= value <= most:
            raise self._unfit(f"its metadata says {key} = {metadata[key][:40]!r}, which is not {least:g} to {most:g}")
        return value

    def _unfit(self, why: str) -> TakeError:
        return TakeError(f"{self._path}: {why}", hint=_HINT)


def _zero_input(given: Any) -> _Input:
    """Return zeros for an input, with length 1 in each dimension that is not fixed."""
    shape = [each if isinstance(each, int) else 1 for each in given.shape]
    kind = np.float32 if given.type == "tensor(float)" else np.int64
    return _Input(given.name, np.zeros(shape, kind))


def resample(samples: Floats, rate_hz: float, wanted_hz: float) -> Floats:
    """Return samples (n,) at another rate, by a windowed sinc with its cut-off at half of the lower rate."""
    if rate_hz == wanted_hz:
        return samples
    cutoff = min(1.0, wanted_hz / rate_hz)
    reach = math.ceil(_TAPS / cutoff)
    positions = np.arange(max(1, int(len(samples) * wanted_hz / rate_hz))) * (rate_hz / wanted_hz)
    padded, out = np.pad(samples, reach + 1), np.empty(len(positions))
    taps = np.arange(-reach, reach + 1)
    for begin in range(0, len(positions), 1 << 14):  # in blocks, because the weights of a block are a matrix
        part = positions[begin : begin + (1 << 14)]
        whole = np.floor(part).astype(int)
        offset = taps[None] - (part - whole)[:, None]
        window = 0.5 + 0.5 * np.cos(np.pi * np.clip(offset / (reach + 1), -1.0, 1.0))
        weights = cutoff * np.sinc(cutoff * offset) * window
        out[begin : begin + len(part)] = (padded[whole[:, None] + taps[None] + reach + 1] * weights).sum(axis=1)
    return out
