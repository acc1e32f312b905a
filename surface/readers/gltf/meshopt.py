"""Decoder of buffer views that meshopt has compressed, as gltfpack and gltf-transform write them.

After the bitstream and the filters that the glTF extension EXT_meshopt_compression specifies (its appendices A and B;
Khronos Group, ratified). Every read is checked, so that damaged data is a :class:`ValueError` and never read past its
end.
"""

# mypy: allow-untyped-defs, disable-error-code="call-arg, var-annotated"
from __future__ import annotations

import numpy as np

from surface.base.arrays import Array
from surface.base.jit import kernel

GROUP = 16  # elements whose deltas of one byte are stored together
ATTRIBUTES, TRIANGLES, INDICES = 0xA0, 0xE1, 0xD1  # first bytes of the three kinds of streams
MIN_TAIL = 32  # bytes at the end of a stream of attributes, the first element's base among them
TABLE = 16  # bytes at the end of a stream of triangles
RESERVED = 4  # bytes at the end of a stream of indices
RESTART, EXPLICIT, FREE = 0xFE, 0xFF, 15  # codes of triangles that are given by more bytes, and of such corners
MODES = {"ATTRIBUTES": ATTRIBUTES, "TRIANGLES": TRIANGLES, "INDICES": INDICES}


def decode_view(data: bytes, mode: str, filtered: str, count: int, stride: int) -> bytes:
    """Return the bytes of a buffer view, ``count * stride`` of them.

    data : the compressed stream. mode : ATTRIBUTES, TRIANGLES or INDICES. filtered : NONE, OCTAHEDRAL or EXPONENTIAL.
    count, stride : elements of the view, and the bytes of each.

    Raises ValueError, with the reason: an unknown mode or filter, numbers that the extension does not allow, or damaged
    data.
    """
    if mode not in MODES:
        raise ValueError(f"mode {mode[:20]!r} is unknown")
    stream = np.frombuffer(data, np.uint8)
    if not len(stream) or stream[0] != MODES[mode]:
        raise ValueError(f"is no stream of {mode.lower()} that this version of meshopt compressed")
    if mode == "ATTRIBUTES":
        return _attributes(stream, filtered, count, stride)
    if stride not in (2, 4) or filtered != "NONE" or (mode == "TRIANGLES" and count % 3):
        raise ValueError(
            f"{count} numbers of {stride} bytes, filter {filtered[:20]}, are not allowed for {mode.lower()}"
        )
    out = np.zeros(count, np.uint32)
    if not (_read_triangles if mode == "TRIANGLES" else _read_indices)(stream, out):
        raise ValueError("is damaged or cut short")
    if stride == 2 and len(out) and out.max() > 0xFFFF:
        raise ValueError(f"holds the number {out.max()}, which has more than two bytes")
    return out.astype("<u2" if stride == 2 else "<u4").tobytes()


def _attributes(stream: Array, filtered: str, count: int, stride: int) -> bytes:
    if not 0 < stride <= 256 or stride % 4:
        raise ValueError(f"elements of {stride} bytes are not allowed")
    out = np.zeros((count, stride), np.uint8)
    if not _read_attributes(stream, out):
        raise ValueError("is damaged or cut short")
    if filtered == "OCTAHEDRAL" and stride in (4, 8):
        return _from_octahedron(out.view("<i1" if stride == 4 else "<i2")).tobytes()
    if filtered == "EXPONENTIAL":
        return _from_exponents(out.view("<i4")).tobytes()
    if filtered != "NONE":
        raise ValueError(f"filter {filtered[:20]!r} of elements of {stride} bytes is not read here")
    return out.tobytes()


def _from_octahedron(packed: Array) -> Array:
    """Return (n, 4): unit vectors as normalised integers, whose fourth number is kept, from points of an octahedron."""
    whole = float(np.iinfo(packed.dtype).max)
    with np.errstate(all="ignore"):
        x, y = (packed[:, k] / packed[:, 2].astype(np.float64) for k in (0, 1))
        z = 1.0 - np.abs(x) - np.abs(y)
        below = np.minimum(z, 0.0)
        vectors = np.column_stack([x - np.copysign(below, x), y - np.copysign(below, y), z])
        vectors /= np.linalg.norm(vectors, axis=1)[:, None]
    out = packed.copy()
    out[:, :3] = np.round(np.nan_to_num(np.clip(vectors, -1.0, 1.0)) * whole)
    return out


def _from_exponents(packed: Array) -> Array:
    """Return float32 numbers from an exponent in the upper eight bits and a whole number in the lower 24; infinite
    where float32 has none so great."""
    with np.errstate(over="ignore", under="ignore"):
        out: Array = np.ldexp(((packed << 8) >> 8).astype(np.float32), packed >> 24).astype("<f4")
    return out


@kernel
def _read_attributes(stream, out):
    """Fill ``out (n, stride)`` uint8; False where the stream holds less or more than that."""
    count, stride = out.shape
    end = len(stream) - max(MIN_TAIL, stride)
    if end < 1:
        return False
    before = stream[len(stream) - stride :].copy()
    room, at = min((8192 // stride) & ~15, 256), 1
    for first in range(0, count, room):
        last = min(first + room, count)
        for k in range(stride):
            at = _read_bytes(stream, at, end, before[k], out[first:last, k])
            if at > end:
                return False
            before[k] = out[last - 1, k]
    return at == end


@kernel
def _read_bytes(stream, at, end, value, out):
    """Fill ``out (n,)`` with one byte of each element, from differences to the one before, which is ``value`` at first;
    returns the place after them, beyond ``end`` where the stream is cut."""
    heads, groups = at, (len(out) + GROUP - 1) // GROUP
    at += (groups + 3) // 4
    steps = np.zeros(GROUP, np.uint8)
    for g in range(groups):
        if at > end:
            return at
        at = _read_group(stream, at, (stream[heads + g // 4] >> np.uint8(2 * (g % 4))) & 3, steps)
        for j in range(min(GROUP, len(out) - g * GROUP)):
            half = steps[j] >> 1
            value = np.uint8(value + (255 - half if steps[j] & 1 else half))
            out[g * GROUP + j] = value
    return at


@kernel
def _read_group(stream, at, kind, steps):
    """Read the differences of a group, stored as nothing, as two or four bits or as bytes; returns the place after
    them. Numbers that two or four bits cannot hold follow as bytes."""
    if kind == 3:
        steps[:] = stream[at : at + GROUP]
        return at + GROUP
    steps[:] = 0
    if kind == 0:
        return at
    width = 2 * kind
    most, each, extra = (1 << width) - 1, 8 // width, at + GROUP * width // 8
    for j in range(GROUP):
        steps[j] = (stream[at + j // each] >> np.uint8(8 - width * (j % each + 1))) & most
        if steps[j] == most:
            steps[j] = stream[extra]
            extra += 1
    return extra


@kernel
def _number(stream, at, end):
    """Return a number of seven bits a byte, the least first, and the place after it; a place beyond ``end`` if it is
    cut."""
    total, shift = np.int64(0), 0
    while at < end and shift < 35:
        byte = np.int64(stream[at])
        at += 1
        total |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            return total & 0xFFFFFFFF, at
    return total, end + 1


@kernel
def _to_signed(number):
    """Return the difference that an unsigned number stands for: 0, -1, 1, -2 ..."""
    return ~(number >> 1) if number & 1 else number >> 1


@kernel
def _read_indices(stream, out):
    """Fill ``out (n,)`` uint32, each a difference from one of two numbers before; False where the stream is damaged."""
    end, at = len(stream) - RESERVED, 1
    last = np.zeros(2, np.int64)
    for k in range(len(out)):
        number, at = _number(stream, at, end)
        if at > end:
            return False
        base = number & 1
        last[base] = (last[base] + _to_signed(number >> 1)) & 0xFFFFFFFF
        out[k] = last[base]
    return at == end


EDGE, CORNER, NEXT, LAST, AT = range(5)  # of a state: edges and corners remembered, two numbers, place in the stream


@kernel
def _read_triangles(stream, out):
    """Fill ``out (3 t,)`` uint32 from codes that refer to the edges and corners before; False where it is damaged."""
    total, end = len(out) // 3, len(stream) - TABLE
    edges, corners, found = np.zeros((16, 2), np.int64), np.zeros(16, np.int64), np.zeros(3, np.int64)
    state = np.zeros(5, np.int64)
    state[AT] = 1 + total
    for t in range(total):
        if state[AT] > end:
            return False
        if stream[1 + t] < 0xF0:
            _beside_edge(stream, end, stream[1 + t], state, edges, corners, found)
        else:
            _anywhere(stream, end, stream[1 + t], state, edges, corners, found)
        for k in range(3):
            out[3 * t + k] = found[k] & 0xFFFFFFFF
    return state[AT] == end


@kernel
def _beside_edge(stream, end, code, state, edges, corners, found):
    """A triangle with an edge of one before it, and a third corner."""
    a, b = edges[(state[EDGE] - 1 - (code >> 4)) & 15]
    third = code & 15
    if 0 < third < 13:
        c = corners[(state[CORNER] - 1 - third) & 15]
    else:
        if third == 0:
            c = _next_index(state)
        elif third < 15:
            state[LAST] += 2 * np.int64(third) - 27  # one less, or one more
            c = state[LAST]
        else:
            c = _read_index(stream, end, state)
        _remember_corner(corners, state, c)
    found[0], found[1], found[2] = a, b, c
    _remember_edge(edges, state, c, b)
    _remember_edge(edges, state, a, c)


@kernel
def _anywhere(stream, end, code, state, edges, corners, found):
    """A triangle whose corners are each the next one, one remembered, or given."""
    if code < RESTART:
        kinds = np.int64(stream[end + (code & 15)])
    else:
        if state[AT] >= end:
            state[AT] = end + 1
            return
        kinds = np.int64(stream[state[AT]])
        state[AT] += 1
        if kinds == 0:
            state[NEXT] = 0
    known = state[CORNER]
    for k in range(3):
        kind = (FREE if code == EXPLICIT else 0) if k == 0 else (kinds >> (8 - 4 * k)) & 15
        if kind == 0:
            found[k] = _next_index(state)
        elif kind == FREE:
            found[k] = _read_index(stream, end, state)
        else:
            found[k] = corners[(known - kind) & 15]
            continue
        _remember_corner(corners, state, found[k])
    for k in range(3):
        _remember_edge(edges, state, found[(k + 1) % 3], found[k])


@kernel
def _next_index(state):
    """Return the number that follows the greatest so far."""
    state[NEXT] += 1
    return state[NEXT] - 1


@kernel
def _read_index(stream, end, state):
    """Return a number that the stream gives, as a difference to the last that was given."""
    number, state[AT] = _number(stream, state[AT], end)
    state[LAST] += _to_signed(number)
    return state[LAST]


@kernel
def _remember_corner(corners, state, corner):
    corners[state[CORNER] & 15] = corner
    state[CORNER] += 1


@kernel
def _remember_edge(edges, state, a, b):
    edges[state[EDGE] & 15, 0], edges[state[EDGE] & 15, 1] = a, b
    state[EDGE] += 1
