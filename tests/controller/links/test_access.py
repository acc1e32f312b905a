"""controller.links.access: tokens and origins."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from controller.base.errors import LinkError
from controller.links.access import given_token, is_own_page, make_token, same_token


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
