"""Format of iCub's face: commands ``set all hap``, ``set mou sad``, one per line.

Source: robotology/icub-main, app/faceExpressions (doc.dox, conf/emotions.ini), with the parts ``mou``, ``eli``,
``leb``, ``reb`` and ``all`` and emotions of three letters. ``configs/vocabularies/icub.toml`` defines the emotions as
parameters. Only the commands are those of iCub's RPC port: YARP's framing is not used, and nothing is answered.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from controller.base.parameters import Flags, Parameters
from controller.base.paths import config_dir
from controller.formats.format import API, Format, nothing
from controller.formats.frame import Frame, Held, Refusals
from controller.vocabulary.presets import Presets

_WORD_COUNT = 3
_MOUTH, _LIDS, _BROWS = ("mouth", "jaw", "cheeks", "nose"), ("lids",), ("brows",)
_TALK = ("ta1", "ta2")
"""Shapes of a speaking mouth, which do not change the rest of the face."""


class IcubDecoder:
    """Decodes commands; parts of the face that are not set keep their values."""

    def __init__(self, parameters: Parameters) -> None:
        self.refused, self._held = Refusals(), Held(parameters)
        self._presets, self._parts = _presets(parameters), _parts(parameters)
        self._held.mask[:] = self._parts["all"]

    def feed(self, message: bytes) -> list[Frame]:
        """Return one frame for a valid command, else none."""
        words = message[:64].decode("ascii", "replace").lower().split()
        if len(words) != _WORD_COUNT or words[0] != "set" or words[1] not in self._parts:
            self.refused.add("no command that sets an emotion")
            return []
        preset = self._presets.find(words[2])
        if preset is None:
            self.refused.add("unknown emotions")
            return []
        part = self._parts["mou" if preset.name in _TALK else words[1]]
        self._held.values[part] = preset.weights[part]
        return [self._held.frame()]


class IcubEncoder:
    """Encodes the emotion that a face resembles most."""

    def __init__(self, parameters: Parameters) -> None:
        presets, self._all = _presets(parameters), _parts(parameters)["all"]
        self._names = [name for name in presets.names if name not in _TALK]
        found = (presets.find(name) for name in self._names)
        self._weights = np.array([preset.weights[self._all] for preset in found if preset is not None])

    def encode(self, frame: Frame) -> list[bytes]:
        """Return one command; none for a frame without a face."""
        if not frame.face:
            return []
        values = np.clip(np.where(frame.mask, frame.values, 0.0), 0.0, 1.0)[self._all]
        distances = np.linalg.norm(self._weights - values, axis=1)
        return [f"set all {self._names[int(np.argmin(distances))]}".encode()]


@cache
def _presets(parameters: Parameters) -> Presets:
    return Presets.load(parameters, config_dir() / "vocabularies" / "icub.toml")


@cache
def _parts(parameters: Parameters) -> dict[str, Flags]:
    """Return a mask (P,) of each part of the face; eyes and head belong to none."""
    regions, names = np.array(parameters.regions), np.array(parameters.names)
    brows = np.isin(regions, _BROWS)
    right = np.char.endswith(names, "Right")
    left = np.char.endswith(names, "Left")
    parts = {
        "mou": np.isin(regions, _MOUTH),
        "eli": np.isin(regions, _LIDS),
        "leb": brows & ~right,
        "reb": brows & ~left,
    }
    return parts | {"all": np.logical_or.reduce(list(parts.values()))}


def _about(parameters: Parameters) -> Flags:
    return _parts(parameters)["all"]


FORMAT = Format(
    api=API,
    kind="icub",
    title="commands of iCub's face, emotions by name",
    transports=("tcp", "udp", "serial", "lines"),
    port=9405,
    decoder=IcubDecoder,
    encoder=IcubEncoder,
    carries=nothing,
    about=_about,
    delimiter=b"\n",
    timeout_s=math.inf,
    note="only the most similar of ten emotions; no eyes and head",
)
