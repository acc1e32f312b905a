"""The end of a closed scan's neck is no skin; the jaw's underside, and necks without an end, are."""

import numpy as np
import pytest

from surface.fit.transfer.detail.broken_neck import without_end
from surface.fit.transfer.scan import Samples, Scan, sample

AXIS, CHIN = np.array([0.0, 0.0, 0.0]), -20.0


def scan_of(heights, spacing=1.0):
    """A sheet that faces down, of y ``heights (n, n)`` over even places of x and z about 0."""
    n = len(heights)
    x, z = np.meshgrid(spacing * (np.arange(n) - n // 2), spacing * (np.arange(n) - n // 2))
    at = np.column_stack([x.ravel(), heights.ravel(), z.ravel()]).astype(float)
    first = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate([first[:, None] + [0, 1, n + 1], first[:, None] + [0, n + 1, n]])
    return Scan(at, faces, np.arange(len(at)))


def stump(step, end=-40.0):
    """A jaw's underside with a neck of 20 mm radius that ends a ``step`` below it, slanting and a little rough."""
    n = 91
    x, z = np.meshgrid(np.arange(n) - n // 2, np.arange(n) - n // 2)
    rough = 0.4 * np.sin(x) * np.cos(1.3 * z) + 0.3 * z
    neck = np.hypot(x, z) < 20.0
    return scan_of(np.where(neck, end + rough, end + step + 0.3 * z)), neck


def left(scan, *, axis=AXIS, chin=CHIN):
    samples = sample(scan, 40_000)
    kept = without_end(samples, scan, axis, chin)
    return samples, kept


def share(samples, kept, radius, outside=False):
    """Of the samples within a radius about the axis, or outside it, the share that is kept; before the axis, because
    behind it nothing that faces down is."""
    far = [(np.hypot(*s.points[:, [0, 2]].T), s.points[:, 2] > 0.0) for s in (samples, kept)]
    inside = [before & ((f > radius) if outside else (f < radius)) for f, before in far]
    return inside[1].sum() / inside[0].sum()


def test_the_end_is_left_out_up_to_the_step_round_it():
    samples, kept = left(stump(8.0)[0])
    assert share(samples, kept, 18.0) < 0.02
    assert share(samples, kept, 22.0, outside=True) > 0.995


def test_skin_that_goes_on_without_a_step_belongs_to_it():
    """Nobody can tell where such an end begins."""
    samples, kept = left(stump(1.0)[0])
    assert len(kept.points) < 0.2 * len(samples.points)


def test_a_neck_that_has_no_end_below_the_chin_stays():
    """What is seen in an open neck from below is the inside of the head."""
    scan, _ = stump(8.0)
    samples, kept = left(scan, chin=-60.0)
    assert len(kept.points) == len(samples.points)
    samples, kept = left(scan, axis=np.array([500.0, 0.0, 0.0]), chin=-60.0)
    assert len(kept.points) == len(samples.points)


@pytest.mark.parametrize(("height", "way", "stays"), [(-40.0, -1.0, False), (-37.0, -1.0, True), (-40.0, 1.0, True)])
def test_samples_that_lie_over_the_end_or_face_up_stay(height, way, stays):
    one = Samples(np.array([[0.0, height, 0.0]]), np.array([[0.0, way, 0.0]]), np.zeros(1, bool))
    assert len(without_end(one, stump(8.0)[0], AXIS, CHIN).points) == stays


def test_a_scan_without_triangles_keeps_its_samples():
    scan, _ = stump(8.0)
    samples = sample(scan, 100)
    assert without_end(samples, scan.kept(np.zeros(len(scan.triangles), bool)), AXIS, CHIN) is samples


def wedge(slope):
    """A nape that ends ``slope`` mm deeper for each mm it goes forward, over a throat that ends flat."""
    z = np.arange(91) - 45
    return scan_of(np.tile(-25.0 + slope * np.minimum(z + 45, 45)[:, None], (1, 91)))


def test_a_nape_that_is_cut_off_on_the_slant_is_left_out_however_steep_it_is():
    for slope in (-1.0, -2.5):
        samples, kept = left(wedge(slope))
        behind = [s.points[:, 2] < -3.0 for s in (samples, kept)]
        assert behind[1].sum() < 0.02 * behind[0].sum()


def test_a_nape_that_faces_down_in_a_spot_stays():
    """As a lock of hair does."""
    heights = np.full((91, 91), -40.0)
    scan = scan_of(heights + 3.0 * np.maximum(0.0, 45.0 - np.arange(91))[:, None])
    samples = sample(scan, 40_000)
    up = np.where(np.hypot(samples.points[:, 0], samples.points[:, 2] + 30.0) < 3.0, -0.5, 0.5)
    turned = Samples(samples.points, np.column_stack([0 * up, up, np.sqrt(1 - up**2)]), samples.border)
    assert 0 < (up < 0.0).mean() < 0.01
    assert len(without_end(turned, scan, AXIS, CHIN).points) == len(turned.points)


def test_samples_beside_a_slanting_end_lie_at_a_border():
    """There the nape already turns to the end; of a stump each millimetre is needed."""
    scan = wedge(-2.0)
    samples = sample(scan, 40_000)
    nape = samples.points[:, 2] < -20.0
    samples.normals[nape] = [0.0, 0.5, -np.sqrt(0.75)]
    kept = without_end(samples, scan, AXIS, CHIN)
    above = kept.points[:, 2] < -20.0
    far = np.sqrt(5.0) * (-20.0 - kept.points[above, 2])  # along the slant
    assert above.sum() == nape.sum()
    assert kept.border[above][far < 5.0].all()
    inner = (np.abs(kept.points[above, 0]) < 30.0) & (far > 7.0) & (far < 40.0)  # the sheet has edges of its own
    assert not kept.border[above][inner].any()
    stub = left(stump(30.0)[0])[1]
    assert not stub.border[(np.hypot(*stub.points[:, [0, 2]].T) < 20.5) & (stub.points[:, 2] > 7.0)].any()
