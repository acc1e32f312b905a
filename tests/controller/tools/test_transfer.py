"""Options of a transfer of expressions."""

from pathlib import Path

import pytest

from controller.base.errors import ConfigError
from controller.tools.transfer import check_transfer, transfer
from surface.base.errors import FitError
from surface.base.progress import no_progress
from surface.fit.source.load import LoadOptions

NONE = {"--shapes": None, "--keep": False}


def test_options_that_go_together_pass():
    check_transfer(None, None, NONE | {"--shapes": Path("shapes")})
    check_transfer("ict", Path("marks.toml"), NONE)


@pytest.mark.parametrize(
    ("source", "landmarks", "others", "message"),
    [
        (None, Path("marks.toml"), NONE, "--landmarks: only"),
        ("ict", None, NONE | {"--shapes": Path("shapes")}, "--shapes: cannot be used with --expressions-from"),
        ("ict", None, NONE | {"--keep": True}, "--keep: cannot"),
    ],
)
def test_options_that_do_not_are_refused(source, landmarks, others, message):
    with pytest.raises(ConfigError, match=message):
        check_transfer(source, landmarks, others)


def test_a_head_that_is_not_there_and_a_scan_that_is_not(tmp_path):
    with pytest.raises(ConfigError, match=r"itc.*did you mean 'ict'"):
        transfer(tmp_path / "a.ply", "itc", tmp_path / "head", "x", None, LoadOptions(), no_progress)
    with pytest.raises(FitError, match="no such"):
        transfer(tmp_path / "a.ply", "ict", tmp_path / "head", "x", None, LoadOptions(), no_progress)
