"""Good files of takes, sounds, recordings and alignments of speech."""

from __future__ import annotations

import json
import math
import struct
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from controller.base.parameters import PARAMETERS
from controller.layers.commands import CommandState
from controller.links.net.neutral import Neutral, Ranges, load_state, save_state
from controller.takes.mcap_files import write_mcap
from controller.takes.recording import recorded
from tests.fuzz.kind import Kind
from tests.fuzz.reading import reports


def wav(samples: np.ndarray, rate: int = 16000) -> bytes:
    """A sound of signed 16 bit mono PCM."""
    data = samples.astype("<i2").tobytes()
    layout = struct.pack("<IHHIIHH", 16, 1, 1, rate, 2 * rate, 2, 16)
    return (
        b"RIFF"
        + struct.pack("<I", 36 + len(data))
        + b"WAVEfmt "
        + layout
        + b"data"
        + struct.pack("<I", len(data))
        + data
    )


def take_kinds(folder: Path) -> list[Kind]:
    """Every kind of take; `folder` takes what is written on the way."""
    names = list(PARAMETERS.names)
    header = (
        "Timecode,BlendShapeCount," + ",".join(n[0].upper() + n[1:] for n in names[:52]) + ",HeadYaw,HeadPitch,HeadRoll"
    )
    rows = [f"00:00:{k // 60:02}:{k % 60:02}.000,61," + ",".join(["0.25"] * 55) for k in range(20)]
    cues = [{"start": 0.0, "end": 0.3, "value": "A"}, {"start": 0.3, "end": 0.9, "value": "D"}]
    return [
        Kind("csv", "take.csv", ["\n".join([header, *rows]).encode()]),
        Kind("tsv", "speech.tsv", [b"0.00\tX\n0.10\tD\n0.40\tB\n0.90\tX\n", b"0.0\taa\n0.5\tPP\n1.0\tsil\n"]),
        Kind("rhubarb", "speech.json", [json.dumps({"metadata": {"duration": 0.9}, "mouthCues": cues}).encode()]),
        Kind("wav", "voice.wav", [wav(8000 * np.sin(np.arange(3000) / 9.0))]),
        *_alignments(),
        *_recorded_by_others(folder / "take.mcap"),
        Kind("recording", "run.rec", [_recording(folder / "run.rec")]),
        Kind("group", "group.json", [_group()]),
        Kind("link", "phone.json", [_learned(folder / "phone.json")], reports(_read_learned)),  # a link reads it
    ]


def _recorded_by_others(path: Path) -> list[Kind]:
    """A take in MCAP, where its package is installed."""
    if find_spec("mcap") is None:
        return []
    values = np.linspace(0.0, 0.5, 20)[:, None] * np.ones(len(PARAMETERS))
    write_mcap(path, np.arange(20) / 30.0, values, np.ones(len(PARAMETERS), bool), PARAMETERS)
    return [Kind("mcap", "take.mcap", [path.read_bytes()])]


def _learned(path: Path) -> bytes:
    """What a link learned of a person."""
    neutral, ranges = Neutral(PARAMETERS), Ranges(PARAMETERS)
    neutral.values[3], neutral.known, ranges.top[5] = 0.2, True, 0.7
    save_state(path, PARAMETERS, neutral, ranges)
    return path.read_bytes()


def _read_learned(path: Path) -> None:
    load_state(path, PARAMETERS, Neutral(PARAMETERS), Ranges(PARAMETERS))


def _results() -> list[dict[str, object]]:
    """Results of MediaPipe's face landmarker: landmarks, and blend shapes as its task for browsers nests them."""
    ring = [{"x": 0.5 + 0.2 * math.cos(k), "y": 0.5 + 0.2 * math.sin(k), "z": 0.01 * (k % 7)} for k in range(478)]
    shapes = [{"categories": [{"categoryName": "jawOpen", "score": 0.4}]}]
    return [{"faceLandmarks": [ring]}, {"faceBlendshapes": shapes, "faceLandmarks": [ring[:468]]}]


RESULTS = _results()


def _alignments() -> list[Kind]:
    """Takes that share their suffixes with others, and alignments of speech."""
    tier = b'"IntervalTier"\n"phones"\n0\n1\n2\n0\n0.4\n"AA1"\n0.4\n1\n"sp"\n'
    grid = b'File type = "ooTextFile"\nObject class = "TextGrid"\n\n0\n1\n<exists>\n1\n' + tier
    fragment = {"begin": "0.0", "end": "1.0", "id": "f1", "language": "eng", "lines": ["Mama"], "children": []}
    shapes = {"FrameIndex": 0, "BlendShapes": [[0.25] * 55] * 3}
    visemes = [{"audio_offset": 500000 * k, "viseme_id": k} for k in range(6)]
    openface = b"frame, timestamp, confidence, success, pose_Rx, pose_Ry, pose_Rz, AU01_r, AU28_c\n"
    openface += b"".join(b"%d, 0.%d, 0.9, 1, 0.1, 0, 0, 2.5, 1\n" % (k, k) for k in range(1, 9))
    pyfeat = b"input,frame,FaceScore,AU01,AU12,approx_time\n"
    pyfeat += b"".join(b"a.mp4,%d,0.9,0.1,0.5,00:0%d\n" % (k * 30, k) for k in range(5))
    return [
        Kind("openface", "of.csv", [openface]), Kind("pyfeat", "feat.csv", [pyfeat]),
        Kind("plain", "plain.csv", [b"time,jawOpen,headYaw_deg\n0,0.1,5\n0.1,0.5,-5\n", b"t;JawOpen\n0;0,5\n1;1\n"]),
        Kind("textgrid", "a.TextGrid", [grid, grid.decode().encode("utf-16")]),
        Kind("aeneas", "aeneas.json", [json.dumps({"fragments": [fragment]}).encode()]),
        Kind("azure-visemes", "visemes.json", [json.dumps(visemes).encode()]),
        Kind("azure-shapes", "shapes.json", [json.dumps(shapes).encode()]),
        Kind("mediapipe", "face.json", [json.dumps(RESULTS * 2).encode()]),
    ]  # fmt: skip


def _recording(path: Path) -> bytes:
    out = PARAMETERS.neutral()
    with recorded(CommandState(PARAMETERS), path) as recorder:
        for k in range(1, 30):
            recorder.set_parameters([3], [0.02 * k], k * 10_000_000)
            recorder.expression("smile", 0.5, None, k * 10_000_000)
            recorder.tick(k * 10_000_000, 0.01, out)
    return path.read_bytes()


def _group() -> bytes:
    table = {"format": 1, "name": "dimple", "part": "face", "ids": [5, 9], "moves_mm": [[0, 0, 1.5], [0.2, 0, 1]]}
    return json.dumps(table).encode()
