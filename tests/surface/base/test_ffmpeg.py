"""Where ffmpeg is found."""

from __future__ import annotations

from pathlib import Path

import pytest

from surface.base import ffmpeg


def test_the_program_on_the_path_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "ffmpeg").write_text("#!/bin/sh\n")
    (tmp_path / "ffmpeg").chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert ffmpeg.find_ffmpeg() == str(tmp_path / "ffmpeg")


def test_without_one_there_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(ffmpeg, "find_spec", lambda name: None)
    assert ffmpeg.find_ffmpeg() is None


def test_only_files_are_read(tmp_path: Path) -> None:
    assert ffmpeg.source(tmp_path / "http:x") == ["-protocol_whitelist", "file,pipe", "-i", f"file:{tmp_path}/http:x"]
