"""Whatever was posed before, a head stands as a fresh evaluation in float64 has it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surface.head import NAMES, Head
from surface.head.model.parameters import read_pose
from surface.head.model.rules import Drivers
from surface.head.posing.part import SkinPart
from surface.head.posing.rig import SkinRig

NORMAL_DEG = 0.05  # how far normals may be off, where the surface is not folded


@pytest.fixture(scope="module")
def head(root: Path) -> Head:
    return Head.load(root / "configs" / "heads" / "ict", {"long": 0.7})


def poses(seed: int) -> list[np.ndarray]:
    """Small and large changes of one parameter, of a few and of all, with head turns and without."""
    rng, values, out = np.random.default_rng(seed), np.zeros(len(NAMES)), []
    for _ in range(40):
        values = values.copy()
        which = rng.choice(len(NAMES), rng.choice([1, 1, 1, 4, len(NAMES)]), replace=False)
        values[which] += rng.choice([1e-7, 1e-3, 1.0]) * rng.uniform(-1, 1, len(which))
        if rng.random() < 0.3:
            values[52:55] = rng.choice([0.0, 1.0]) * rng.uniform(-1, 1, 3)
        out.append(values)
    return out


def assert_exact(head: Head, part: SkinPart) -> None:
    """Vertices and normals are those of the control points, computed in float64 and turned by scipy."""
    surface, mesh, m = part.surface.with_points(part.control_points), part.mesh, len(part.mesh.vertices)
    at, su, sv = surface.derivatives(mesh.uv, side=mesh.side)
    normals, pivot = np.cross(su, sv) * (-1 if mesh.flip else 1), np.array(head.data.neck.pivot)
    folded = np.linalg.norm(normals, axis=1)
    turns = Rotation.from_rotvec(part.share[:, None] * Rotation.from_matrix(part.turn).as_rotvec())
    sewn = np.concatenate([np.zeros(0, int), *(s.ids for s in head.stitches if s.second is part)])
    free = np.setdiff1d(np.arange(m), sewn)
    wanted, size = turns.apply(at - pivot) + pivot, np.ptp(surface.points, axis=0).max()
    assert np.abs(part.vertices[:m] - wanted)[free].max() < 1e-6 * size, part.name
    unit = turns.apply(normals / folded[:, None])
    off = np.degrees(np.linalg.norm(part.normals[:m] - unit, axis=1)) * np.minimum(1, folded / np.median(folded))
    assert off[free].max() < NORMAL_DEG, part.name


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_random_sequences_end_where_a_fresh_evaluation_does(head: Head, seed: int) -> None:
    for k, values in enumerate(poses(seed)):
        head.pose(values)
        if k % 13 == 12:
            for part in head.parts:
                if isinstance(part, SkinPart):
                    assert_exact(head, part)


@pytest.mark.slow
def test_control_points_do_not_depend_on_the_poses_before(head: Head) -> None:
    sequence = poses(2)
    for values in sequence:
        head.pose(values)
    fresh, drivers = read_pose(sequence[-1]), Drivers(head.data.rules)
    for data in (p for p in head.data.parts if p.follows == "skin"):
        found = SkinRig(data, head.data, drivers).apply(fresh)
        np.testing.assert_allclose(head.part(data.name).control_points, found, atol=1e-9)
