"""controller.fleet.payload: what is sent comes back, and what is damaged is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

from controller.base.errors import LinkError
from controller.base.parameters import PARAMETERS as P
from controller.fleet.lease import Token
from controller.fleet.payload import ENCODINGS, Header, Payloads
from controller.formats.frame import Frame
from controller.formats.kinds.binary_format import BinaryEncoder


def face(seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform(P.low, P.high)


def test_a_header_comes_back() -> None:
    header = Header(Token(7, 2**61), 2**40, -5, 9, stopped=True)
    assert Header.decode(header.encode()) == header
    with pytest.raises(LinkError, match="bytes"):
        Header.decode(b"\1" * 7)
    with pytest.raises(LinkError, match="version 9"):
        Header.decode(b"\x09" + header.encode()[1:])


@pytest.mark.parametrize("kind", ["exact", "json"])
def test_every_bit_of_a_face_comes_back(kind: str) -> None:
    sender, values = Payloads(P, kind), face()
    np.testing.assert_array_equal(Payloads(P).decode(sender.encode(values), sender.encoding), values)


def test_the_binary_payload_is_omotes_binary_frame() -> None:
    sender, values = Payloads(P, "binary"), face()
    data = sender.encode(values)
    assert data == BinaryEncoder(P).encode(Frame(values, np.ones(len(P), bool)))[0]
    np.testing.assert_allclose(Payloads(P).decode(data, sender.encoding), values, atol=0.51 / 16384)


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (b"", "exact"), (Payloads(P).encode(face())[:-1], "exact"), (Payloads(P).encode(face() * np.nan), "exact"),
        (b"\1\2\3", "binary"), (b"{", "json"), (b"[]", "json"),
        (b'{"version": 1, "parameters": {"jawOpen": "x"}}', "json"),
        (b'{"version": 2, "parameters": {}}', "json"), (b'{"version": 1, "parameters": {"jawOpen": NaN}}', "json"),
        (b" " * 70_000, "json"),
    ],
)  # fmt: skip
def test_a_damaged_face_is_refused(data: bytes, kind: str) -> None:
    with pytest.raises(LinkError):
        Payloads(P).decode(data, ENCODINGS[kind])
    with pytest.raises(LinkError, match="not understood"):
        Payloads(P).decode(data[:100], "text/plain")


LARGEST = 2**63 - 1


@pytest.mark.parametrize("header", [Header(Token(2**64 - 1, 5), 1, 1), Header(Token(1, 5), 1, LARGEST),
                                    Header(Token(1, 5), 1, 1, -LARGEST - 1)])  # fmt: skip
def test_a_header_is_refused_with_which_computing_would_leave_64_bits(header: Header) -> None:
    """As the fence of the next conductor, and the time of a command by one's own clock."""
    with pytest.raises(LinkError, match="out of range"):
        Header.decode(header.encode())


def test_values_are_kept_in_their_ranges_and_unknown_names_are_left_out() -> None:
    data = json.dumps({"version": 1, "parameters": {"jawOpen": 3.0, "antenna": 1.0}}).encode()
    values = Payloads(P).decode(data, "application/json")
    assert values[P.index("jawOpen")] == 1.0 and np.count_nonzero(values) == 1
