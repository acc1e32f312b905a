"""Faces of voices by networks that are made here, small enough to say what they must give."""

from __future__ import annotations

import wave
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from controller.base.errors import TakeError
from controller.base.parameters import PARAMETERS as P
from controller.takes.voices import network
from controller.takes.voices.network import Network, network_take, resample
from controller.tools.motion_file import convert
from surface.base.errors import MissingPackage

onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")
JAW, SMILE = P.index("jawOpen"), P.index("mouthSmileLeft")


def model(path: Path, nodes: list[Any], output: tuple[int | str, ...], audio: tuple[int | str, ...] = (1, "n"),
          more: tuple[Any, ...] = (), **said: str) -> Path:  # fmt: skip
    """A network of some nodes from ``voice`` to ``face``."""
    make, kind = onnx.helper, onnx.TensorProto.FLOAT
    graph = make.make_graph(
        nodes, "g", [make.make_tensor_value_info("voice", kind, audio), *more],
        [make.make_tensor_value_info("face", kind, output)],
    )  # fmt: skip
    made = make.make_model(graph, opset_imports=[make.make_opsetid("", 17)], ir_version=8)
    onnx.helper.set_model_props(made, said)
    path.write_bytes(made.SerializeToString())
    return path


def constant(name: str, values: Any, dtype: Any = np.float32) -> Any:
    return onnx.helper.make_node("Constant", [], [name], value=onnx.numpy_helper.from_array(np.array(values, dtype)))


def loudness(path: Path, audio: tuple[int | str, ...] = (1, "n"), step: int = 160, **said: str) -> Path:
    """Jaw and smile by the mean of |voice| over every ``step`` samples, times 1 and a half: (1, t, 2)."""
    node = onnx.helper.make_node
    nodes = [
        node("Abs", ["voice"], ["loud"]),
        constant("shape", [1, -1, step], np.int64), node("Reshape", ["loud", "shape"], ["cut"]),
        node("ReduceMean", ["cut"], ["mean"], axes=[2], keepdims=1),
        constant("gains", [[1.0, 0.5]]), node("MatMul", ["mean", "gains"], ["face"]),
    ]  # fmt: skip
    return model(path, nodes, (1, "t", 2), audio, **{"names": "jawOpen,mouthSmileLeft", **said})


def sound(path: Path, samples: np.ndarray, rate: int = 16_000) -> Path:
    with wave.open(str(path), "wb") as file:
        file.setparams((1, 2, rate, 0, "NONE", ""))
        file.writeframes(np.round(32767 * samples).astype("<i2").tobytes())
    return path


def test_an_hour_of_a_voice_is_read_at_most(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    original = network.open_sound

    def noting(stream: Any, where: str) -> Any:
        opened = original(stream, where)
        return SimpleNamespace(format=opened.format, read=lambda count: asked.append(count) or opened.read(count))

    monkeypatch.setattr(network, "open_sound", noting)
    network_take(sound(tmp_path / "a.wav", np.zeros(16_000)), loudness(tmp_path / "net.onnx"), P)
    assert asked == [3600 * 16_000]


def steps() -> np.ndarray:
    """A second of silence, one at a half, one at a quarter."""
    return np.repeat([0.0, 0.5, 0.25], 16_000)


@pytest.mark.parametrize("audio", [(1, "n"), (1, 8000)])
def test_a_network_gives_a_take(tmp_path: Path, audio: tuple[int | str, ...]) -> None:
    take = network_take(sound(tmp_path / "a.wav", steps()), loudness(tmp_path / "m.onnx", audio), P)
    assert len(take.times_s) == 300 and take.times_s[0] == 0.0 and np.allclose(np.diff(take.times_s), 0.01)
    assert np.flatnonzero(take.mask).tolist() == sorted([JAW, SMILE])
    for second, level in enumerate((0.0, 0.5, 0.25)):
        assert take.values[100 * second + 50, JAW] == pytest.approx(level, abs=1e-3)
        assert take.values[100 * second + 50, SMILE] == pytest.approx(level / 2, abs=1e-3)


def test_a_network_of_single_moments_slides_over_the_voice(tmp_path: Path) -> None:
    node = onnx.helper.make_node
    zero = onnx.helper.make_tensor_value_info("style", onnx.TensorProto.FLOAT, ["b", 1])
    nodes = [node("Abs", ["voice"], ["loud"]), node("ReduceMean", ["loud"], ["mean"], axes=[0], keepdims=1),
             constant("one", [[1.0] * 52]), node("Mul", ["mean", "one"], ["many"]),
             node("Add", ["many", "style"], ["face"])]  # fmt: skip
    path = model(tmp_path / "m.onnx", nodes, (1, 52), (1600,), (zero,), fps="50")
    take = network_take(sound(tmp_path / "a.wav", steps()), path, P)
    assert len(take.times_s) == 150 and np.allclose(np.diff(take.times_s), 0.02) and take.mask.sum() == 52
    assert [take.values[n, JAW] for n in (25, 75, 125)] == pytest.approx([0.0, 0.5, 0.25], abs=1e-3)


def test_omote_convert_takes_a_model(tmp_path: Path) -> None:
    motion = convert(sound(tmp_path / "a.wav", steps()), tmp_path / "a.csv", P, model=loudness(tmp_path / "m.onnx"))
    assert motion.mask.sum() == 2 and (tmp_path / "a.csv").read_text().startswith("time,jawOpen,mouthSmileLeft\n")


def test_a_model_for_another_rate_gets_that_rate(tmp_path: Path) -> None:
    path = loudness(tmp_path / "m.onnx", step=80, sample_rate="8000")
    assert len(network_take(sound(tmp_path / "a.wav", steps(), 16_000), path, P).times_s) == 300


@pytest.mark.parametrize(("rate", "wanted"), [(44_100, 16_000), (8_000, 16_000), (48_000, 16_000)])
def test_tones_keep_their_pitch_and_those_too_high_vanish(rate: int, wanted: int) -> None:
    low = resample(np.sin(2 * np.pi * 440 * np.arange(rate) / rate), rate, wanted)
    assert len(low) == wanted
    np.testing.assert_allclose(low[200:-200], np.sin(2 * np.pi * 440 * np.arange(wanted) / wanted)[200:-200], atol=0.01)
    if rate > wanted:
        high = resample(np.sin(2 * np.pi * 11_000 * np.arange(rate) / rate), rate, wanted)
        assert np.abs(high[200:-200]).max() < 0.02


def test_a_long_sound_is_resampled_block_by_block_without_a_gap() -> None:
    ramp = np.linspace(-1.0, 1.0, 20_000)
    found = resample(ramp, 8_000, 16_000)
    assert len(found) == 40_000  # more than two blocks of 16384
    np.testing.assert_allclose(
        found[100:-100], np.interp(np.arange(40_000) / 2, np.arange(20_000), ramp)[100:-100], atol=2e-3
    )


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ({"names": "jawOpen"}, "it gives 2 values, and has 1 names"),
        ({"names": "a,b"}, "none of its names is a parameter"),
        ({"sample_rate": "fast"}, "sample_rate = 'fast', which is not 4000 to 192000"),
        ({"fps": "0"}, "fps = '0', which is not 1 to 240"),
        ({"fps": "0.9"}, "which is not 1 to 240"),
        ({"fps": "240.1"}, "which is not 1 to 240"),
        ({"sample_rate": "3999"}, "which is not 4000 to 192000"),
        ({"sample_rate": "192001"}, "which is not 4000 to 192000"),
        ({"fps": 99 * "x"}, f"fps = '{40 * 'x'}', which is not"),
    ],
)
def test_a_network_of_another_sort_is_told(tmp_path: Path, said: dict[str, str], told: str) -> None:
    with pytest.raises(TakeError, match=told):
        Network(loudness(tmp_path / "m.onnx", **said), P)


def test_what_is_no_network_is_told(tmp_path: Path) -> None:
    (tmp_path / "m.onnx").write_bytes(b"nothing of the kind")
    with pytest.raises(TakeError, match=r"m\.onnx: not an ONNX network"):
        Network(tmp_path / "m.onnx", P)
    with pytest.raises(TakeError, match="cannot be read"):
        Network(tmp_path / "none.onnx", P)


def test_a_missing_package_is_named_with_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("surface.base.extras.find_spec", lambda name: None)
    with pytest.raises(MissingPackage) as caught:
        Network(tmp_path / "m.onnx", P)
    assert "omote[onnx]" in caught.value.hint
