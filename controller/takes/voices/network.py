"""Faces of a voice by a network that the user gives as a file in ONNX (the extra onnx).

What a network must be like: its first input takes samples of a voice, float32 in -1..1, as (n,) or (1, n); n may be
fixed. Its first output has ARKit's names in its last dimension, as (..., t, k) for t moments of the piece, or (k,) and
(1, k) for its middle. Metadata of the model may say ``sample_rate`` (16000), ``fps`` (30, of those with one moment) and
``names`` (separated by commas; those of ``LIST PARAMETERS`` in order without). Further inputs get zeros.
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
_PIECE_S, _LONGEST_S = 20.0, 3600.0
_TAPS = 32  # of the low-pass filter, on each side and for each sample of the slower rate
_HINT = "docs of omote, expression: what a network that makes faces of voices must be like"


def network_take(path: Path, model: Path, parameters: Parameters) -> Take:
    """A take of a WAV file by a network.

    Raises TakeError: the sound or the model cannot be read, or the model is of another sort. MissingPackage:
    onnxruntime is not installed.
    """
    network = Network(model, parameters)
    with files.reading(path, TakeError), files.open_file(path) as stream:
        sound = open_sound(stream, str(path))
        samples = sound.format.samples(sound.read(int(_LONGEST_S * sound.format.rate_hz)))
    if not len(samples):
        raise TakeError(f"{path}: no sound in it", hint="record it again")
    times, values = network.faces(resampled(samples, sound.format.rate_hz, network.rate_hz))
    mask = np.zeros(len(parameters), dtype=bool)
    mask[network.at] = True
    return Take(path.name, times, values, mask, parameters.low, parameters.high)


@dataclass(frozen=True)
class _Input:
    """An input besides the voice: what it is filled with."""

    name: str
    zeros: np.ndarray


class Network:
    """A network that is ready to run.

    Attributes
    ----------
    rate_hz : of the samples that it takes. at : (k',) positions of the parameters that it gives.

    Raises TakeError, MissingPackage: as :func:`network_take`.
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
            raise TakeError(f"{path}: no network in ONNX: {why}", hint=_HINT) from error
        self._path, self._parameters = path, parameters
        said = self._session.get_modelmeta().custom_metadata_map
        self.rate_hz = round(self._number(said, "sample_rate", _RATE_HZ, 4000, 192_000))
        self._fps = self._number(said, "fps", _FPS, 1, 240)
        voice, *others = self._session.get_inputs()
        self._voice, self._rank = voice.name, len(voice.shape)
        self._size = voice.shape[-1] if voice.shape and isinstance(voice.shape[-1], int) else None
        if self._rank not in (1, 2) or voice.type != "tensor(float)":
            raise self._unfit(f"its first input is {voice.type} of {self._rank} dimensions, not samples of a voice")
        self._others = [_filled(each) for each in others]
        self._columns, self.at = self._outputs(said.get("names"))

    def faces(self, samples: Floats) -> tuple[Floats, Floats]:
        """Times (n,) s and values (n, P) of the samples of a voice (k,). Raises TakeError: the network fails."""
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
        at = np.concatenate(times)
        return at - at[0], self._values(np.concatenate(rows))

    def _slide(self, samples: Floats) -> tuple[Floats, Floats]:
        """One moment for each window: that of its middle."""
        size = self._size or round(0.5 * self.rate_hz)
        times = np.arange(max(1, int(len(samples) / self.rate_hz * self._fps))) / self._fps
        padded = np.pad(samples, (size // 2, size))
        begins = (times * self.rate_hz).astype(int)
        return times, self._values(np.concatenate([self._run(padded[b : b + size]) for b in begins]))

    def _run(self, samples: Floats) -> Floats:
        """(t, k) what the network makes of samples (n,)."""
        given = samples.astype(np.float32).reshape((1, -1) if self._rank == 2 else (-1,))
        try:
            first, *_ = self._session.run(
                None, {self._voice: given, **{each.name: each.zeros for each in self._others}}
            )
        except Exception as error:  # as above
            raise self._unfit(f"it fails: {str(error).splitlines()[0][:200]}") from error
        found = np.asarray(first, dtype=np.float64)
        rows: Floats = np.nan_to_num(found.reshape(-1, found.shape[-1]))
        return rows

    def _outputs(self, names: str | None) -> tuple[Indices, Indices]:
        """Columns of the output that are parameters, and their positions."""
        probe = self._run(np.zeros(self._size or self.rate_hz))
        self._single = len(probe) == 1
        listed = (
            [name.strip() for name in names.split(",")] if names else list(self._parameters.names[: probe.shape[1]])
        )
        if len(listed) != probe.shape[1]:
            raise self._unfit(f"it gives {probe.shape[1]} values, and has {len(listed)} names for them")
        places = [(column, self._parameters.find(name)) for column, name in enumerate(listed)]
        known = [(column, at) for column, at in places if at is not None]
        if not known:
            raise self._unfit("none of its names is a parameter")
        columns, at = zip(*known, strict=True)
        return np.array(columns), np.array(at)

    def _values(self, rows: Floats) -> Floats:
        values = np.zeros((len(rows), len(self._parameters)))
        values[:, self.at] = rows[:, self._columns]
        return np.clip(values, self._parameters.low, self._parameters.high)

    def _number(self, said: dict[str, str], key: str, usual: float, least: float, most: float) -> float:
        try:
            value = float(said.get(key, usual))
        except ValueError:
            value = math.nan
        if not least <= value <= most:
            raise self._unfit(f"its metadata says {key} = {said[key][:40]!r}, which is not {least:g} to {most:g}")
        return value

    def _unfit(self, why: str) -> TakeError:
        return TakeError(f"{self._path}: {why}", hint=_HINT)


def _filled(given: Any) -> _Input:
    """Zeros for an input, with 1 for each dimension that is not fixed."""
    shape = [each if isinstance(each, int) else 1 for each in given.shape]
    kind = np.float32 if given.type == "tensor(float)" else np.int64
    return _Input(given.name, np.zeros(shape, kind))


def resampled(samples: Floats, rate_hz: float, wanted_hz: float) -> Floats:
    """Samples (n,) at another rate, by a windowed sinc that lets nothing above half of the lower rate through."""
    if rate_hz == wanted_hz:
        return samples
    share = min(1.0, wanted_hz / rate_hz)
    reach = math.ceil(_TAPS / share)
    places = np.arange(max(1, int(len(samples) * wanted_hz / rate_hz))) * (rate_hz / wanted_hz)
    padded, out = np.pad(samples, reach + 1), np.empty(len(places))
    taps = np.arange(-reach, reach + 1)
    for begin in range(0, len(places), 1 << 14):  # some thousand at a time: the weights are a matrix
        part = places[begin : begin + (1 << 14)]
        whole = np.floor(part).astype(int)
        away = taps[None] - (part - whole)[:, None]
        weights = share * np.sinc(share * away) * (0.5 + 0.5 * np.cos(np.pi * np.clip(away / (reach + 1), -1.0, 1.0)))
        out[begin : begin + len(part)] = (padded[whole[:, None] + taps[None] + reach + 1] * weights).sum(axis=1)
    return out
