"""controller.links.web.pages: what is served, to whom, and with which headers."""

from __future__ import annotations

import gzip
import re
from importlib.resources import files as package_files
from pathlib import Path

import pytest
from websockets.datastructures import Headers
from websockets.http11 import Request

from controller.links.web.pages import FILES, Face, is_local_name, page

STATIC = package_files("controller.links.web") / "static"


def test_every_file_of_the_folder_is_served_whole() -> None:
    assert {name for name, _ in FILES.values()} == {file.name for file in STATIC.iterdir()}
    for path, (name, kind) in FILES.items():
        answer = page(path)
        assert answer.status_code == 200 and answer.headers["Content-Type"] == kind
        assert gzip.decompress(answer.body) == (STATIC / name).read_bytes()
        assert int(answer.headers["Content-Length"]) == len(answer.body)


@pytest.mark.parametrize(
    "path", ["/server.py", "/../server.py", "//", "/static/panel.js", "/%2e%2e/kind.py", "/" + "a" * 1999]
)
def test_nothing_else_is_served(path: str) -> None:
    answer = page(path)
    assert answer.status_code == 404
    assert answer.body == f"there is no {path[:80]} here; the panel is at /\n".encode()


def test_scripts_import_only_what_is_served_and_pages_have_nothing_inline() -> None:
    for file in STATIC.iterdir():
        if file.name.endswith(".js") and file.name != "three.min.js":
            for wanted in re.findall(r'from "([^"]+)"', file.read_text(encoding="utf-8")):
                assert wanted in FILES, (file.name, wanted)
    html = (STATIC / "index.html").read_text(encoding="utf-8")
    assert "style=" not in html and "onclick=" not in html and not re.search(r"<script[^>]*>[^<]", html)
    assert "'self'" in page("/").headers["Content-Security-Policy"]
    assert "unsafe" not in page("/").headers["Content-Security-Policy"]


def test_a_face_may_appear_later(tmp_path: Path) -> None:
    face = Face(tmp_path / "face.glb")
    early = face.answer()
    assert early.status_code == 503 and early.headers["Retry-After"] == "1"
    (tmp_path / "face.glb").write_bytes(b"glTF...")
    answer = face.answer()
    assert answer.status_code == 200 and gzip.decompress(answer.body) == b"glTF..."
    assert Face(None).answer().status_code == 404


def test_what_a_browser_has_is_not_sent_again_until_it_changes(tmp_path: Path) -> None:
    (tmp_path / "face.glb").write_bytes(b"glTF, the first")
    face = Face(tmp_path / "face.glb")
    for answer in (face.answer, lambda known=None: page("/three.min.js", known)):
        tag = answer().headers["ETag"]
        assert re.fullmatch(r'"[0-9a-f]{32}"', tag)
        for known in (tag, f'"other", W/{tag}', "*"):
            again = answer(known)
            assert (again.status_code, again.body, again.headers["ETag"]) == (304, b"", tag)
            assert "Content-Length" not in again.headers and "Content-Security-Policy" in again.headers
        assert answer('"other"').status_code == 200 and answer(tag.strip('"')).status_code == 200
    (tmp_path / "face.glb").write_bytes(b"glTF, the second")
    assert Face(tmp_path / "face.glb").answer(face.answer().headers["ETag"]).status_code == 200


@pytest.mark.parametrize(
    ("host", "good"),
    [("127.0.0.1:8080", True), ("localhost", True), ("[::1]:8080", True), ("192.168.1.4", True),
     ("evil.example:8080", False), ("127.0.0.1.evil.example", False), ("", False), ("a@evil.example", False)],
)  # fmt: skip
def test_names_that_others_may_have_pointed_here_are_refused(host: str, good: bool) -> None:
    assert is_local_name(Request("/", Headers({"Host": host}))) == good
