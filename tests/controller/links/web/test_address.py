"""controller.links.web.address: what a person reads, or a phone's camera."""

from __future__ import annotations

import ipaddress

import pytest

from controller.links.web.address import address, own_address, qr_code


def test_the_token_stands_where_browsers_keep_it_to_themselves() -> None:
    assert address("127.0.0.1", 8080, None) == "http://127.0.0.1:8080/"
    assert address("::1", 80, "abc") == "http://[::1]:80/#token=abc"


def test_an_address_for_all_networks_becomes_one_that_can_be_typed() -> None:
    own = own_address()
    assert own and own != "0.0.0.0"
    assert own in address("0.0.0.0", 8080, "abc")
    if own.replace(".", "").isdigit():
        assert ipaddress.ip_address(own)


def test_the_qr_code_is_read_by_a_decoder() -> None:
    pytest.importorskip("segno", reason="needs segno (extra web)")
    cv2 = pytest.importorskip("cv2", reason="needs opencv (development only)")
    np = pytest.importorskip("numpy")
    url = "http://192.168.1.4:8080/#token=abcdefghijkl"
    halves = {" ": (0, 0), "\N{UPPER HALF BLOCK}": (1, 0), "\N{LOWER HALF BLOCK}": (0, 1), "\N{FULL BLOCK}": (1, 1)}
    lines = [line for line in qr_code(url).splitlines() if line.strip("\x1b[0m")]
    assert lines, "it draws"
    cells = [[halves[letter] for letter in line if letter in halves] for line in lines]
    width = max(map(len, cells))
    rows = np.zeros((2 * len(cells), width), np.uint8)
    for y, line in enumerate(cells):
        for x, (upper, lower) in enumerate(line):
            rows[2 * y, x], rows[2 * y + 1, x] = upper, lower
    for picture in (rows * 255, (1 - rows) * 255):
        large = np.pad(np.kron(picture, np.ones((8, 8), np.uint8)), 40, constant_values=255)
        if cv2.QRCodeDetector().detectAndDecode(large)[0] == url:
            return
    pytest.fail("no decoder reads it")
