"""controller.links.access: tokens and origins."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from controller.base.errors import LinkError
from controller.links.access import (
    WebRequests,
    check_reach,
    check_word,
    given_token,
    host_and_port,
    is_own_page,
    make_token,
    same_token,
    token_for,
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path / "omote"


def test_a_token_is_made_once_and_is_for_its_user_only(folder: Path) -> None:
    token, path, new = make_token()
    assert new and len(token) >= 20 and path.parent == folder
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert make_token() == (token, path, False)


def test_another_user_gets_another_token(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, _, _ = make_token()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "other"))
    assert make_token()[0] != first


def test_a_token_that_cannot_be_kept_is_an_error(folder: Path) -> None:
    folder.parent.joinpath("omote").write_text("in the way")
    with pytest.raises(LinkError, match="token"):
        make_token()


@pytest.mark.parametrize(
    ("target", "header", "found"),
    [
        ("/?token=abc", None, "abc"),
        ("/", "Bearer abc", "abc"),
        ("/?token=x", "Bearer abc", "abc"),
        ("/", None, ""),
        ("/?token=a%20b", None, "a b"),
        ("/", "Basic abc", ""),
        ("//[", None, ""),
    ],
)
def test_where_a_client_may_write_its_token(target: str, header: str | None, found: str) -> None:
    assert given_token(target, header) == found


def test_tokens_are_compared_whole() -> None:
    assert same_token("abc", "abc")
    assert not any(same_token(given, "abc") for given in ("", "ab", "abcd", "ABC", "äbc"))


@pytest.mark.parametrize(
    ("origin", "may"),
    [
        ("http://localhost:8080", True),
        ("http://127.0.0.1", True),
        ("http://[::1]:3000", True),
        ("https://example.org", True),
        ("https://example.org.evil.net", False),
        ("http://localhost.evil.net", False),
        ("http://192.168.0.4", False),
        ("null", False),
        ("http://[", False),
    ],
)
def test_pages_of_this_machine_and_of_the_list_may_connect(origin: str, may: bool) -> None:
    assert is_own_page(origin, ["https://example.org"]) == may


def test_a_token_is_needed_beyond_this_machine_only(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert token_for("line", "127.0.0.1", None) is None and token_for("line", "localhost", "own") == "own"
    assert not folder.exists()
    made = token_for("line 0.0.0.0:1", "0.0.0.0", None)
    assert made is not None and f"shown only now: {made}" in caplog.text
    caplog.clear()
    assert token_for("line 0.0.0.0:1", "0.0.0.0", None) == made
    assert "line 0.0.0.0:1: other machines may move this face" in caplog.text and made not in caplog.text


def test_addresses() -> None:
    assert host_and_port("[::1]:80", 1) == ("::1", 80) and host_and_port("robot.local:80", 1) == ("robot.local", 80)
    for wrong in ("", "80", ":80", "a:", "a:x", "a:65536"):
        with pytest.raises(ValueError, match=r'write it as "127\.0\.0\.1:7"'):
            host_and_port(wrong, 7)


def test_who_may_be_reached_by_others() -> None:
    check_reach("127.0.0.1", None, open_to_network=False)
    check_reach("0.0.0.0", "x" * 12, open_to_network=True)
    with pytest.raises(ValueError, match="open_to_network"):
        check_reach("10.0.0.1", None, open_to_network=False)
    with pytest.raises(ValueError, match="at least 12"):
        check_reach("127.0.0.1", "x" * 11, open_to_network=False)
    with pytest.raises(ValueError, match="printable ASCII"):
        check_word("two words of it")


@pytest.mark.parametrize("size", [1, 3, 7, 1000])
@pytest.mark.parametrize(
    ("stream", "web"),
    [
        (b"POST / HTTP/1.1\r\nX: y", True),
        (b"GET /a/b?c HTTP/1.0\r\n", True),
        (b"POST /" + b"a" * 5000 + b" HTTP/1.1\r\nHost: localhost:9404\r\n", True),
        (b"\r\nhost: x", True),
        (b"GET jawOpen\nSET jawOpen 0.5\nPING HTTP/1.1\n", False),
        (b'{"host": "x"}\n', False),
        (b"PING host: x\n" * 300, False),
    ],
)
def test_requests_of_browsers_are_noticed_wherever_their_pieces_end(stream: bytes, web: bool, size: int) -> None:
    requests = WebRequests()
    found = [requests.begins(stream[at : at + size]) for at in range(0, len(stream), size)]
    assert any(found) == web
