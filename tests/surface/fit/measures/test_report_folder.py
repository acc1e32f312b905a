"""A report's files appear together at the end, or not at all; errors have the colours of their scale."""

import numpy as np
import pytest

from surface.base.error_colours import FULL_MM, SCALE, error_colours
from surface.base.errors import FitError
from surface.fit.measures.report_folder import report_folder


def test_files_appear_at_the_end_and_replace_older_ones(tmp_path):
    folder = tmp_path / "new" / "report"
    for text in ("first", "second"):
        with report_folder(folder) as made:
            (made / "report.md").write_text(text)
            assert not folder.exists() or (folder / "report.md").read_text() == "first"
        assert (folder / "report.md").read_text() == text
    assert [path.name for path in folder.parent.iterdir()] == ["report"]


def test_an_error_leaves_the_folder_as_it_was(tmp_path):
    with pytest.raises(ValueError, match="no picture"), report_folder(tmp_path / "report") as made:
        (made / "report.md").write_text("half")
        raise ValueError("no picture")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(FitError, match="the report cannot be written") as caught, report_folder(file / "report"):
        pass
    assert "--report" in caught.value.hint


def test_errors_go_from_the_first_to_the_last_colour():
    got = error_colours(np.array([0.0, FULL_MM / 8, FULL_MM, 5.0 * FULL_MM]))
    np.testing.assert_allclose(got, [SCALE[0], SCALE[:2].mean(axis=0), SCALE[-1], SCALE[-1]])
