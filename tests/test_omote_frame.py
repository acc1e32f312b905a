"""examples/4_knob_face: the header reads what omote writes and the other way round; C and C++ compile it."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from controller.base.parameters import PARAMETERS as P
from controller.formats.frame import Frame, Refusals, Splitter
from controller.formats.kinds.binary_format import BinaryDecoder, BinaryEncoder
from tests.arduino import STUB
from tests.controller.formats.faces import face

FOLDER = Path(__file__).resolve().parent.parent / "examples" / "4_knob_face"
STRICT = ["-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wno-unused-function"]
SANITIZED = "-fsanitize=address,undefined"
ECHO = """
#include <stdio.h>
#include "omote_frame.h"
int main(void) {
  static omote_receiver r;
  uint8_t out[OMOTE_LONGEST];
  int c;
  while ((c = getchar()) != EOF)
    if (omote_read(&r, (uint8_t)c))
      fwrite(out, 1, omote_write(r.values, r.given, r.sequence, r.milliseconds, out), stdout);
  fprintf(stderr, "%u", r.refused);
  return 0;
}
"""


def build(folder: Path, compiler: str, standard: str, source: str, *options: str) -> Path:
    if shutil.which(compiler) is None:
        pytest.skip(f"needs {compiler}")
    path = folder / ("echo.c" if compiler == "gcc" else "echo.cpp")
    path.write_text(source)
    program = folder / f"echo-{compiler}"
    command = [compiler, f"-std={standard}", *options, f"-I{FOLDER}", str(path), "-o", str(program)]
    done = subprocess.run([*command, SANITIZED], capture_output=True, text=True, timeout=120)
    if done.returncode:  # not every compiler has its sanitizers installed
        done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return program


@pytest.fixture(scope="module", params=[("gcc", "c99"), ("g++", "c++11")], ids=["C", "C++"])
def echo(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A program that writes every good frame again."""
    compiler, standard = request.param
    return build(tmp_path_factory.mktemp("echo"), compiler, standard, ECHO, *STRICT)


def through(program: Path, data: bytes) -> tuple[list[Frame], int]:
    """Frames that come out of a program, and how many it refused."""
    done = subprocess.run([program], input=data, capture_output=True, timeout=60)
    assert done.returncode == 0, done.stderr
    decoder = BinaryDecoder(P)
    messages = Splitter(b"\0", 1024, Refusals()).feed(done.stdout)
    return [frame for message in messages for frame in decoder.feed(message)], int(done.stderr)


def test_faces_go_into_the_header_and_out_again(echo: Path) -> None:
    encoder, sent = BinaryEncoder(P), [face(seed, seed / 60) for seed in range(40)]
    sent.append(Frame(sent[0].values, np.arange(len(P)) % 3 == 0, 9.5))
    found, refused = through(echo, b"".join(encoder.encode(frame)[0] + b"\0" for frame in sent))
    assert len(found) == len(sent) and refused == 0
    for before, after in zip(sent, found, strict=True):
        np.testing.assert_allclose(after.values[before.mask], before.values[before.mask], atol=1e-4)
        assert (after.mask == before.mask).all()
    assert [frame.sequence for frame in found] == list(range(41)) and found[-1].time_s == 9.5


def test_the_header_names_every_parameter_in_its_place() -> None:
    names = re.search(r"enum \{([A-Z_,\s]+)\};", (FOLDER / "omote_frame.h").read_text())
    assert names is not None
    spelt = [name.strip().removeprefix("OMOTE_").replace("_", "").lower() for name in names[1].split(",")]
    assert spelt == [name.lower() for name in P.names]


def test_rubbish_is_refused_and_the_next_frame_is_read(echo: Path) -> None:
    encoder, rng = BinaryEncoder(P), np.random.default_rng(1)
    good = [encoder.encode(face(seed))[0] + b"\0" for seed in range(30)]
    data = b""
    for message in good:
        damaged = bytearray(message)
        damaged[int(rng.integers(len(damaged) - 1))] ^= 1 << int(rng.integers(8))
        data += rng.bytes(int(rng.integers(400))) + b"\0" + bytes(damaged) + b"\0" + message
    found, refused = through(echo, data)
    assert len(found) == 30 and refused >= 30


def test_the_sketch_compiles_and_opens_the_jaw(tmp_path: Path) -> None:
    more = "size_t serial_write(const uint8_t *d, size_t n) { return (size_t)write(1, d, n); }\n"
    more += "void analogWrite(int, int) {}\n"
    sketch = (FOLDER / "4_knob_face.ino").read_text().replace("Serial.write", "serial_write")
    code = f"{STUB}{more}{sketch}\nint main() {{ setup(); for (;;) loop(); }}\n"
    program = build(tmp_path, "g++", "c++11", code)
    (tmp_path / "inputs").write_text("512 1")
    with subprocess.Popen(
        [program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env={"INPUTS": str(tmp_path / "inputs")}
    ) as run:
        assert run.stdout is not None
        splitter, decoder, frames = Splitter(b"\0", 1024, Refusals()), BinaryDecoder(P), list[Frame]()
        while len(frames) < 3:
            frames += [frame for message in splitter.feed(run.stdout.read(1)) for frame in decoder.feed(message)]
        run.kill()
    assert frames[-1].mask.sum() == 1
    assert frames[-1].values[P.index("jawOpen")] == pytest.approx(512 / 1023, abs=1e-4)
