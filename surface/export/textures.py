"""Materials and textures of exported heads: eyes, and strands that thin out; see ``materials.toml``."""

from __future__ import annotations

import struct
import zlib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surface.base import files
from surface.base.arrays import Floats
from surface.export.shapes import ExportPart
from surface.head.model.parameters import smoothstep
from surface.readers.meshdata import linear, srgb

Picture = NDArray[np.uint8]
#: Threshold of the alpha test of strands.
STRAND_CUTOFF = 0.3
EYE_RIM = 0.47  # of an eye's picture: how far from its middle the eye's own equator lies
_PUPIL = 0.38  # radius of a pupil, in radii of its iris
_PNG_KINDS = {1: 0, 3: 2, 4: 6}


@cache
def materials() -> dict[str, Any]:
    """Return the table of materials beside this module."""
    return files.read_toml(Path(__file__).with_name("materials.toml"))


def png_bytes(picture: Picture) -> bytes:
    """Return a picture (height, width, channels) uint8 of 1, 3 or 4 channels, top row first, as a PNG file; without
    Pillow, which exporting does not need.

    (PNG specification, second edition: signature, IHDR, IDAT, IEND.)
    """
    height, width, channels = picture.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), picture.reshape(height, -1)], axis=1)
    header = struct.pack(">IIBBBBB", width, height, 8, _PNG_KINDS[channels], 0, 0, 0)
    out = b"\x89PNG\r\n\x1a\n"
    for kind, data in ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b"")):
        out += struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    return out


def encode_srgb(intensity: Floats) -> Picture:
    """Return linear colours 0..1 as sRGB bytes."""
    return np.rint(255.0 * srgb(np.clip(intensity, 0.0, 1.0))).astype(np.uint8)


def eye_column(part: ExportPart) -> Picture:
    """Return (256, 4, 3): pupil, iris and white along v of an eye part; the first row is its top, where v is 1."""
    stops, plain = materials()["eye_texture"], materials()["eye_colours"]
    colours = np.array([stop["colour"] for stop in stops])
    for k, stop in enumerate(stops):
        wanted = part.painted.get(stop.get("of", ""))
        if wanted is not None:
            share = linear(colours[k]) * np.asarray(wanted, float) / np.array(plain[stop["of"]])
            colours[k] = encode_srgb(share) / 255.0
    v = 1.0 - (np.arange(256) + 0.5) / 256
    column = np.stack([np.interp(v, [stop["v"] for stop in stops], colours[:, k]) for k in range(3)], axis=1)
    return np.repeat(np.rint(255 * column).astype(np.uint8)[:, None], 4, axis=1)


def eye_rings(part: ExportPart) -> list[tuple[str, float, float, Floats]]:
    """Return the pupil, iris and white of an eye part, where a mesh has one colour.

    Of each the name, from and to which distance from the eye's axis it reaches, in the eye's radii, and linear RGB.
    """
    iris, sclera, radius = _eye_colours(part)
    pupil = _PUPIL * radius
    rings = [("pupil", 0.0, pupil, np.full(3, 0.01)), ("iris", pupil, radius, iris), ("sclera", radius, np.inf, sclera)]
    return [(name, low, high, np.clip(colour, 0.0, 1.0)) for name, low, high, colour in rings]


def _eye_colours(part: ExportPart) -> tuple[Floats, Floats, float]:
    """Return linear RGB of iris and white, and the radius of the iris in those of the eyeball."""
    plain = materials()["eye_colours"]
    iris, sclera = (np.asarray(part.painted.get(name, plain[name]), float) for name in ("iris", "sclera"))
    return iris, sclera, float(np.ravel(part.painted.get("iris_radius", plain["iris_radius"]))[0])


def eye_picture(part: ExportPart, size: int = 256) -> Picture:
    """Return (size, size, 3): an eye looked at from the front, as far as :data:`EYE_RIM`; fibres run out from the
    pupil."""
    iris, sclera, radius = _eye_colours(part)
    y, x = (((np.arange(size) + 0.5) / size - 0.5) / EYE_RIM for _ in range(2))
    r, angle = np.hypot(y[:, None], x[None]), np.arctan2(y[:, None], x[None])
    q = r / radius
    t = (q - _PUPIL) / (1.0 - _PUPIL)
    fibre = _fibres(angle, t)
    tint = iris * (0.5 + 1.1 * fibre)[..., None]
    tint += np.array([0.10, 0.065, 0.03]) * (fibre * (1.0 - smoothstep(np.abs(t - 0.26), 0.18, 0.42)))[..., None]
    tint *= ((1.0 - 0.8 * smoothstep(t, 0.72, 1.0)) * smoothstep(t, -0.06, 0.12))[..., None]
    white = sclera * (1.0 - smoothstep(r, 0.60, 1.0)[..., None] * (1.0 - np.array([0.92, 0.70, 0.62])))
    share = smoothstep(q, 0.90, 1.06)[..., None]
    return encode_srgb(tint * (1.0 - share) + white * share)


def picture_radii(part: ExportPart) -> tuple[float, float]:
    """Return the radii of the iris and of its pupil in :func:`eye_picture`, in widths of the picture."""
    iris = EYE_RIM * _eye_colours(part)[2]
    return iris, _PUPIL * iris


def _fibres(angle: Floats, t: Floats) -> Floats:
    """Return the brightness of fibres, about 0.5, by the angle about the pupil and how far out they are."""
    random, out = np.random.default_rng(11), np.full(angle.shape, 0.5)
    for count in (17, 23, 31, 43, 61, 83):
        phase, wave, drift = random.uniform(0.0, 2.0 * np.pi, 3)
        out += 0.085 * np.sin(count * angle + phase + 1.4 * np.sin(3.0 * t + wave) + drift * t)
    bright: Floats = np.clip(out, 0.0, 1.0)
    return bright


def strip_picture(fade: tuple[float, float, float, float], soft: bool, size: tuple[int, int] = (64, 256)) -> Picture:
    """Return (height, width, 4): cover of a strip of brow or lashes: along it from left to right, roots below.

    fade : cover at the root, at the tip, share of the length over which each end fades, and strength of the strands.
    soft : its long sides fade, too.
    """
    height, width = size
    along, across = (np.arange(width) + 0.5) / width, 1.0 - (np.arange(height)[:, None] + 0.5) / height
    ends = np.clip(np.minimum(along, 1.0 - along) / max(fade[2], 1e-3), 0.0, 1.0)
    lean = np.mod(along + 0.10 * across, 1.0)
    strand = np.interp(lean, np.linspace(0.0, 1.0, width), np.random.default_rng(5).uniform(-0.5, 0.5, width))
    cover = (fade[0] + (fade[1] - fade[0]) * across**2) * ends + 0.45 * fade[3] * strand * ends
    if soft:
        cover = cover * smoothstep(across, 0.0, 0.34) * (1.0 - 0.7 * smoothstep(across, 0.60, 1.0))
    picture = np.full((height, width, 4), 255, np.uint8)
    picture[..., 3] = np.rint(255 * np.clip(cover, 0.0, 1.0)).astype(np.uint8)
    return picture


def strand_picture(size: int = 128) -> Picture:
    """Return (size, size, 4): noise that tiles: brightness of strands, and alpha that, times a vertex's cover, falls
    below :data:`STRAND_CUTOFF` where the strand is taller than the cover."""
    random = np.random.default_rng(7)
    fine, coarse, light = (_tiling_noise(random, size, falloff) for falloff in (0.5, 1.0, 0.5))
    height = np.clip(0.5 + 0.21 * coarse + 0.13 * fine, 0.05, 2.0)
    picture = np.zeros((size, size, 4), np.uint8)
    picture[..., :3] = encode_srgb(np.clip(0.62 + 0.14 * light + 0.10 * coarse, 0.1, 1.0))[..., None]
    picture[..., 3] = np.rint(255 * np.clip(STRAND_CUTOFF / height, 0.0, 1.0)).astype(np.uint8)
    return picture


def _tiling_noise(random: np.random.Generator, size: int, falloff: float) -> Floats:
    """Return noise (size, size) that tiles, zero mean, unit deviation; amplitude falls as frequency**-falloff."""
    frequency = np.fft.fftfreq(size) * size
    radius = np.hypot(frequency[:, None], frequency[None, :])
    shape = np.where(radius > 2.0, np.maximum(radius, 1.0) ** -falloff, 0.0)
    noise = np.fft.ifft2(np.fft.fft2(random.standard_normal((size, size))) * shape).real
    even: Floats = (noise - noise.mean()) / noise.std()
    return even
