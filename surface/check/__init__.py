"""Checks a head by its geometry: what a user would see and not want.

In: a head. Out: findings, each with what is wrong, where, and what to type next. Imports base, mesh, head, view.scene.
"""

from surface.check.checker import check_head
from surface.check.findings import Finding

__all__ = ["Finding", "check_head"]
