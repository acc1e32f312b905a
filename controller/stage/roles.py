"""Reduces a stage to what a process with one role runs: conductor, head, face or recorder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from controller.base.errors import ConfigError
from controller.base.parameters import did_you_mean
from controller.stage.heads import HeadSettings
from controller.stage.stage import Stage
from controller.stage.zenoh import ROLES, ZenohSettings


def with_role(settings: ZenohSettings, role: str | None, heads: Sequence[str]) -> ZenohSettings:
    """Return ``[zenoh]`` with the role and heads of the command line, if given. Raises ConfigError: no such role."""
    if role is not None and role not in ROLES:
        raise ConfigError(f"--role {role}: no such role{did_you_mean(role, ROLES)}", hint=f"roles: {', '.join(ROLES)}")
    wanted: dict[str, object] = {"role": role} if role is not None else {}
    return settings.model_copy(update=wanted | ({"heads": list(heads)} if heads else {}))


def for_role(stage: Stage, role: str | None = None, heads: Sequence[str] = ()) -> Stage:
    """Reduce a stage to what the process with a role runs, with only the heads of this process.

    Only a conductor has links and plays takes, shows and voices; only a ``head`` drives servos.

    Raises ConfigError: no such role or head, or the stage has no ``[zenoh]``.
    """
    table = stage.settings.zenoh
    if table is None:
        if role is not None:
            raise ConfigError("--role: the stage has no [zenoh]", hint='[zenoh]\nlisten = ["tcp/127.0.0.1:7447"]')
        return stage
    table = with_role(table, role, heads)
    kept = _local_heads(stage, table)
    settings = stage.settings.model_copy(update={"zenoh": table, "heads": kept})
    names = {head.name for head in kept}
    local = tuple(replace(head, stage=_strip(head.stage, table.role)) for head in stage.heads if head.name in names)
    return replace(_strip(replace(stage, settings=settings), table.role), heads=local)


def _local_heads(stage: Stage, table: ZenohSettings) -> list[HeadSettings]:
    """Return the settings of the heads of this process. Raises ConfigError: it names an unknown head."""
    known = {head.name.lower(): head for head in stage.settings.heads}
    unknown = [name for name in table.heads if name.lower() not in known]
    if unknown:
        raise ConfigError(f"zenoh.heads: no head called {unknown[0]!r}{did_you_mean(unknown[0], known)}",
                          hint=f"heads of this stage: {', '.join(known) or 'one, without a name'}")  # fmt: skip
    wanted = {name.lower() for name in table.heads}
    return [head for head in stage.settings.heads if not wanted or head.name.lower() in wanted]


def _strip(stage: Stage, role: str) -> Stage:
    """Remove links and sources, unless ``role`` is the conductor, and robots, unless it is ``head``."""
    update: dict[str, object] = {}
    if role != "conductor":
        update = {"links": [], "show": None, "take": None, "voice": None, "turns": "manual"}
    robots = stage.robots if role == "head" else ()
    return replace(stage, robots=robots, settings=stage.settings.model_copy(update=update))
