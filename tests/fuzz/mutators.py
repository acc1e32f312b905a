"""Small damages to a file: bytes, numbers, names and structure, drawn from a seeded generator."""

from __future__ import annotations

import io
import random
import re
import zipfile
from collections.abc import Callable

from tests.fuzz.structures import damage_arrays, damage_tree

Mutator = Callable[[bytes, random.Random], bytes]

NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")
WORD = re.compile(rb"[A-Za-z_]{2,}")
EXTREMES = (
    *(b"0", b"-0.0", b"-1", b"1", b"2", b"1e308", b"-1e308", b"1e-320", b"1e12", b"nan", b"inf", b"-inf", b"1e999"),
    *(b"255", b"256", b"65535", b"65536", b"2147483647", b"-2147483648", b"4294967296", b"9223372036854775808"),
    *(b"99999999999999999999999999", b'""', b"''", b"[]", b"{}", b"null", b"true", b'"\\u0000"', b"1_0", b"0x10"),
)
TOKENS = (
    *(b"{", b"}", b"[", b"]", b'"', b"'", b",", b":", b"=", b"\n", b"\r", b"\0", b"\t", b"#", b"<", b">", b"&", b"\\"),
)


def flip_bits(data: bytes, draw: random.Random) -> bytes:
    """Flip one to eight bits."""
    out = bytearray(data)
    for _ in range(draw.randint(1, 8)):
        out[draw.randrange(len(out))] ^= 1 << draw.randrange(8)
    return bytes(out)


def replace_bytes(data: bytes, draw: random.Random) -> bytes:
    """Overwrite a short run with random, all-zero or all-one bytes."""
    at, size = draw.randrange(len(data)), draw.choice((1, 2, 4, 8, 32))
    run = draw.choice((b"\0" * size, b"\xff" * size, draw.randbytes(size)))
    return data[:at] + run + data[at + size :]


def cut_end(data: bytes, draw: random.Random) -> bytes:
    """Truncate."""
    return data[: draw.randrange(len(data))]


def remove_run(data: bytes, draw: random.Random) -> bytes:
    """Leave out a run."""
    at = draw.randrange(len(data))
    return data[:at] + data[at + draw.randint(1, max(1, len(data) // 4)) :]


def repeat_run(data: bytes, draw: random.Random) -> bytes:
    """Say a run several times."""
    at = draw.randrange(len(data))
    run = data[at : at + draw.randint(1, 200)]
    return data[:at] + run * draw.choice((2, 3, 50)) + data[at:]


def insert_token(data: bytes, draw: random.Random) -> bytes:
    """Put a bracket, quote, separator or control character somewhere, once or very often."""
    at = draw.randrange(len(data) + 1)
    return data[:at] + draw.choice(TOKENS) * draw.choice((1, 1, 1, 2, 5000)) + data[at:]


def replace_number(data: bytes, draw: random.Random) -> bytes:
    """One number becomes an extreme one, or another kind of value."""
    return _replace(NUMBER, data, draw, lambda _: draw.choice(EXTREMES))


def replace_word(data: bytes, draw: random.Random) -> bytes:
    """One name becomes another name of the file, or a very long one."""
    others = WORD.findall(data) or [b"x"]
    return _replace(WORD, data, draw, lambda _: draw.choice((draw.choice(others), b"x" * 5000, b"../../etc/passwd")))


def shuffle_lines(data: bytes, draw: random.Random) -> bytes:
    """Two lines change places, or one is said twice or left out."""
    lines = data.split(b"\n")
    a, b = draw.randrange(len(lines)), draw.randrange(len(lines))
    match draw.randrange(3):
        case 0:
            lines[a], lines[b] = lines[b], lines[a]
        case 1:
            lines.insert(a, lines[b])
        case _:
            del lines[a]
    return b"\n".join(lines)


def _replace(pattern: re.Pattern[bytes], data: bytes, draw: random.Random, new: Callable[[bytes], bytes]) -> bytes:
    found = [m.span() for m in pattern.finditer(data[:200_000])]
    if not found:
        return data
    start, end = draw.choice(found)
    return data[:start] + new(data[start:end]) + data[end:]


MUTATORS: tuple[Mutator, ...] = (
    *(flip_bits, replace_bytes, cut_end, remove_run, repeat_run, insert_token),
    *(replace_number, replace_number, replace_word, shuffle_lines),
)


def inside_archive(data: bytes, draw: random.Random) -> bytes:
    """Damage one member of a zip file, whose checksums are made to fit: otherwise nothing inside is ever looked at."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = draw.choice(list(members))
    members[name] = draw.choice(MUTATORS)(members[name], draw)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for each, content in members.items():
            archive.writestr(each, content)
    return out.getvalue()


def mutate(data: bytes, draw: random.Random) -> bytes:
    """One to three damages, one after the other: to what the file says, or to its bytes."""
    if draw.random() < 0.65:
        sound = (damage_arrays if data.startswith(b"PK") else damage_tree)(data, draw)
        if sound is not None:
            return sound
    if data.startswith(b"PK") and draw.random() < 0.6:
        return inside_archive(data, draw)
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        if data:
            data = draw.choice(MUTATORS)(data, draw)
    return data
