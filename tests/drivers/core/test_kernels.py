"""drivers.core.kernels: compiled before a bus is under torque, and right for every packet."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.core import kernels
from drivers.packets.packet import crc16

KERNELS = [value for value in vars(kernels).values() if hasattr(value, "signatures")]


@pytest.mark.parametrize("kernel", KERNELS, ids=lambda kernel: kernel.__name__)
def test_nothing_is_compiled_at_its_first_call(kernel) -> None:  # type: ignore[no-untyped-def]
    assert len(kernel.signatures) == 1
    assert not kernel._can_compile


def test_a_checksum_goes_on_from_any_byte() -> None:
    data = np.random.default_rng(1).integers(0, 256, 50, dtype=np.uint8)
    for cut in (0, 1, 25, 50):
        begun = kernels.crc_span(data, 0, cut, 0)
        assert kernels.crc_span(data, cut, 50, begun) == crc16(data.tobytes())


def test_travel_that_was_not_used_is_saved_up_to_a_burst() -> None:
    wide, budget, last = np.full(2, 9.0), np.zeros(2), np.zeros(2)
    target, speed = np.array([1.0, -1.0]), np.array([0.5, 10.0])
    assert kernels.limit_targets(target, -wide, wide, speed, 0.1, 0.2, target.copy(), budget, last) == (0, 0, 1)
    np.testing.assert_allclose(last, [0.05, -1.0])
    here = last.copy()
    assert kernels.limit_targets(here, -wide, wide, speed, 100.0, 0.2, here.copy(), budget, last) == (0, 0, 0)
    np.testing.assert_allclose(budget, [0.1, 2.0])


@pytest.mark.parametrize(
    ("data", "sign", "value"),
    [
        (b"\xfe\xff", kernels.UNSIGNED, 0xFFFE),
        (b"\xfe\xff", kernels.TWOS_COMPLEMENT, -2),
        (b"\xff\xff\xff\x7f", kernels.TWOS_COMPLEMENT, 2**31 - 1),
        (b"\x03\x04", kernels.SIGN_MAGNITUDE, -3),
        (b"\x03\x00", kernels.SIGN_MAGNITUDE, 3),
        (b"", kernels.TWOS_COMPLEMENT, 0),
    ],
)
def test_registers_of_every_kind_of_sign(data: bytes, sign: int, value: int) -> None:
    octets = np.frombuffer(b"\x55\x55" + data, np.uint8)
    assert kernels.register(octets, 1, np.array([1, len(data), sign])) == value


def test_a_header_is_found_only_as_a_whole() -> None:
    data = np.frombuffer(b"\xff\xff\xfd\xff\xff", np.uint8)
    assert kernels.has_header(data, 0, 3)
    assert not kernels.has_header(data, 0, 2)
    assert not kernels.has_header(data, 1, 5)
