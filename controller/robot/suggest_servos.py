"""Suggest where a further servo would help a robot most: the point and the direction that reduce the error most.

A servo moves the skin along its direction, with a weight that falls off around its point, as for anchors
(:func:`controller.robot.anchors.servo_field`). The residual of a face is the displacement of the skin that the robot's
servos do not reach. For one face the best pull of a further servo is the least-squares one. Of all directions at a
point the best is the eigenvector with the greatest eigenvalue of the sum of v v^T over the faces, where v is the
weighted sum of the residual. Every sampled point of the skin is tried.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from controller.base.parameters import Floats, Parameters
from controller.robot.anchors import AnchorSolver, falloff
from surface.head.model.parameters import SHAPES

REACH_MM = 15.0
"""Reach of the servos that are tried; it is the default reach of anchors."""
_MIN_IMPROVEMENT_MM = 0.05  # rms, within its reach, for a servo to be suggested


@dataclass(frozen=True)
class Suggestion:
    """A further servo.

    point : (3,) mm. direction : (3,) unit vector. pull_mm : greatest pull that it needs, either way.
    region : of the face.
    before_mm, after_mm : residual of the skin within its reach, without and with it, rms over the faces.
    skin_before_mm, skin_after_mm : the same for the whole skin.
    """

    point: Floats
    direction: Floats
    pull_mm: float
    region: str
    before_mm: float
    after_mm: float
    skin_before_mm: float
    skin_after_mm: float


def suggest_servos(
    solver: AnchorSolver, faces: Mapping[str, Floats], parameters: Parameters, count: int = 2
) -> Iterator[Suggestion]:
    """Suggest up to ``count`` further servos for faces, each given by its parameters (p,).

    The best comes first; each is chosen with the servos before it in place. Servos that would hardly help are left out.
    """
    left = np.array([solver.residual(solver.shape_values(face)) for face in faces.values()])  # (f, m, 3)
    shares = np.array(
        [falloff(solver.skin, at, jaw, REACH_MM) for at, jaw in zip(solver.skin.rest, solver.skin.jaw, strict=True)]
    )  # fmt: skip  (m, m)
    regions = _regions(solver, parameters)
    for _ in range(count):
        j, direction = _best(shares, left)
        pulls = _pulls(shares[j], direction, left)
        after = left - pulls[:, None, None] * shares[j][None, :, None] * direction
        near = shares[j] > 0.0
        found = Suggestion(
            solver.skin.rest[j], direction, float(np.abs(pulls).max()), regions[j],
            _rms(left[:, near]), _rms(after[:, near]), _rms(left), _rms(after),
        )  # fmt: skip
        if found.before_mm - found.after_mm < _MIN_IMPROVEMENT_MM:
            return
        yield found
        left = after


def _best(shares: Floats, left: Floats) -> tuple[int, Floats]:
    """Index of the point, and direction (3,), that reduce the residuals ``left`` : (f, m, 3) most."""
    weighed = np.einsum("jm,fmc->jfc", shares, left)
    matrices = np.einsum("jfc,jfd->jcd", weighed, weighed)
    values, vectors = np.linalg.eigh(matrices)
    gain = values[:, -1] / np.maximum((shares**2).sum(axis=1), 1e-9)
    j = int(np.argmax(gain))
    direction: Floats = vectors[j, :, -1]
    return j, direction * (1.0 if (weighed[j] @ direction).sum() >= 0.0 else -1.0)


def _pulls(share: Floats, direction: Floats, left: Floats) -> Floats:
    """(f,) mm, the least-squares pull for the residual of each face."""
    pulls: Floats = np.einsum("m,fmc,c->f", share, left, direction) / max(float((share**2).sum()), 1e-9)
    return pulls


def _rms(moves: Floats) -> float:
    return float(np.sqrt((moves**2).sum(axis=-1).mean()))


def _regions(solver: AnchorSolver, parameters: Parameters) -> list[str]:
    """The region of each point: that of the shape that moves it most."""
    most = np.linalg.norm(solver.skin.moves.sum(axis=3), axis=1).argmax(axis=1)
    return [parameters.regions[parameters.index(SHAPES[s])] for s in most]


def described(found: Suggestion) -> str:
    """Describe a suggestion in one line, with point and direction written as the keys of an anchor."""
    point, direction = ([round(float(x), digits) for x in each] for each, digits in
                        ((found.point, 1), (found.direction, 2)))  # fmt: skip
    return (
        f"a further servo would help most in the region {found.region}, at point = {point}, direction = {direction}, "
        f"up to {found.pull_mm:.1f} mm: there {found.before_mm:.1f} mm left would become {found.after_mm:.1f}, of the "
        f"whole skin {found.skin_before_mm:.2f} -> {found.skin_after_mm:.2f} mm (rms)"
    )
