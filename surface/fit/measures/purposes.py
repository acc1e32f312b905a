"""What a head does otherwise than its mesh on purpose, so that this is told from errors of the fit.

Correctives change pairs of shapes, or the end of one; rules let the tongue give way to teeth and lips; and a part that
follows skull or jaw as a whole, as gums do, leaves out what the mesh's shapes do to it besides.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from surface.base.arrays import Floats
from surface.check.subject import Subject, pose_of
from surface.fit.features.finish import is_on_purpose
from surface.fit.points.report import NEUTRAL
from surface.head.model.data import HeadData, Rule
from surface.head.model.parameters import SHAPES, read_pose
from surface.head.posing.rig import rigid_motion

RIGID = ("skull", "jaw")  # what parts follow as a whole


def without_changes(head: HeadData) -> tuple[HeadData, list[str]]:
    """The head without the rules that change shapes of its mesh on purpose, and the shapes that these change when they
    are shown alone."""
    rules = [r for r in head.rules if is_on_purpose(r)]
    changed = [n for n in SHAPES if any(_is_active(rule, pose_of(n)) for rule in rules)]
    return replace(head, rules=[r for r in head.rules if r not in rules]), changed


def _is_active(rule: Rule, pose: Mapping[str, float]) -> bool:
    return all(sum(share * pose.get(name, 0.0) for name, share in term.items()) > 0.0 for term in rule.terms)


def moved_as_a_whole(subject: Subject, follows: str, vertices: Floats, shape: str) -> Floats:
    """Return vertices (n, 3) of a mesh as what follows skull or jaw moves them in the pose that shows a shape."""
    pose = read_pose(subject.head.values({} if shape == NEUTRAL else pose_of(shape)))
    linear, shift = rigid_motion(follows, subject.head.data, pose)
    moved: Floats = vertices @ linear.T + shift
    return moved
