"""Transfers that do not follow their scans are refused, put beside their place, and can be forced."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from small_head import small_head

from surface.base.errors import FitError
from surface.fit.points.report import Errors, FitReport, PartReport
from surface.fit.transfer import api, faults
from surface.fit.transfer.align import Similarity
from surface.fit.transfer.faults import faults_of_transfer, turned_over
from surface.head import Head

AREA = 40.0 * 40.0  # mm² of the small head's first patch, seen from the front


@pytest.fixture(scope="module")
def source() -> Head:
    return Head(small_head())


def errors(p99: float, samples: int = 1000) -> list[PartReport]:
    return [PartReport("face", 25, samples, 0, Errors(0.3 * p99, p99, 2.0 * p99), {})]


def folded(share: float):
    """The head with its first patch mirrored in x, as far as ``share`` of its width."""
    data = small_head()
    points = data.parts[0].points.copy()
    left = points[:, 0].min()
    low = points[:, 0] < left + 40.0 * share
    points[low, 0] = 2.0 * (left + 40.0 * share) - points[low, 0]
    return replace(data, parts=[replace(data.parts[0], points=points), *data.parts[1:]])


def test_a_face_that_follows_its_scan_is_no_fault(source: Head) -> None:
    assert faults_of_transfer(errors(3.9), 0.3, small_head(), source) == []


@pytest.mark.parametrize(
    ("parts", "matched", "words"),
    [
        (errors(4.2), 0.9, "does not follow the scan: 1 % of it is 4 mm away"),
        (errors(0.5), 0.2, "only 20 % of the face's front lies on the scan"),
        (errors(0.0, samples=0), 0.9, "no part of the face"),
        ([], 0.0, "no part of the face"),
    ],
)
def test_a_face_that_does_not_is_one(source: Head, parts: list[PartReport], matched: float, words: str) -> None:
    (fault,) = faults_of_transfer(parts, matched, small_head(), source)
    assert words in fault


def test_what_is_turned_over_is_measured_against_the_head_it_was_made_from(source: Head) -> None:
    assert turned_over(small_head(), source) == 0.0
    moved = small_head()
    moved = replace(moved, parts=[replace(p, points=p.points * [1.2, 0.9, 1.1] + 5.0) for p in moved.parts])
    assert turned_over(moved, source) == 0.0
    whole = folded(1.0)
    assert turned_over(whole, source) == pytest.approx(AREA, rel=0.15)
    (fault,) = faults_of_transfer(errors(0.5), 0.9, whole, source)
    assert "mm² of the face are inside out at rest" in fault


def test_triangles_without_area_are_turned_nowhere() -> None:
    part = SimpleNamespace(triangles=np.array([[0, 1, 2], [0, 1, 1], [0, 2, 1]]))
    normals, area = faults._normals(part, np.array([[0.0, 0, 0], [3, 0, 0], [0, 4, 0]]))  # type: ignore[arg-type]
    np.testing.assert_allclose(normals, [[0, 0, 1], [0, 0, 0], [0, 0, -1]])
    np.testing.assert_allclose(area, [6.0, 0.0, 6.0])


def test_a_refused_transfer_lies_beside_its_place_unless_forced(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    report = SimpleNamespace(fit=FitReport("small", errors(9.0), [], faults=("it is 9 mm off",)))
    made = api.Transferred(small_head(), report, Similarity(np.eye(3), 1.0, np.zeros(3), 1.0))
    monkeypatch.setattr(api, "read_scan", lambda *_: None)
    monkeypatch.setattr(api.Head, "load", lambda _: None)
    monkeypatch.setattr(api, "transfer", lambda *_: made)
    out = tmp_path / "head"
    with pytest.raises(FitError, match="refused: it is 9 mm off; it was written to ") as caught:
        api.transfer_head("scan.obj", "ict", out, name="small")
    assert not out.exists() and (tmp_path / "head-refused" / "head.toml").exists()
    assert "omote landmarks" in caught.value.hint and "--force" in caught.value.hint
    assert api.transfer_head("scan.obj", "ict", out, name="small", force=True) is report
    assert (out / "head.toml").exists()
