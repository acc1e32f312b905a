"""Three to six servos with rods to one plate: Stewart platforms, and necks of three rods on a joint or a spring."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from controller.robot.linkages.kind import API, LinkageKind
from controller.robot.linkages.kinds.differential_linkage import RodSettings, make_rods


class StewartSettings(RodSettings):
    """As many inputs as servos."""

    channels: Annotated[list[str], Field(min_length=3, max_length=6)]


LINKAGE = LinkageKind(
    api=API,
    kind="stewart",
    title="three to six servos with rods to one plate",
    settings=StewartSettings,
    make=make_rods,
)
