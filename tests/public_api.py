"""The public API as text: a line for each name that others may rely on, with how it is called.

``python -m tests.public_api`` prints it; ``make api`` writes it to tests/public_api.txt, which a test compares.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Iterator
from importlib import import_module
from typing import Any

from drivers.core.registry import FAMILIES

WHOLE = ("surface", "surface.head", "surface.view", "surface.fit", "surface.readers", "surface.export", "drivers",
         "drivers.sim", "drivers.testing")  # fmt: skip
"""Packages of which everything in ``__all__`` is public."""

SINGLE = {
    "drivers.base.bus": ("Bus", "BusReport", "BusState", "ServoInfo", "ServoSpec"),
    "drivers.base.options": ("REQUIRED", "option", "parse_ids"),
    "drivers.boards.bus": ("BoardBus",),
    "drivers.boards.hobby": ("PulseScale", "check_hobby"),
    "drivers.core.families": ("API", "AnySettings", "Family", "PulseSettings", "ServoSettings"),
    "drivers.core.wirebus": ("WireBus",),
    "drivers.port.serialport": ("SerialPort",),
    "drivers.sim.boards.board": ("Board",),
    "drivers.sim.serving.virtual": ("VirtualBus", "VirtualClock", "VirtualLink"),
    "drivers.sim.wire.line": ("FixedReader", "Line", "Reader"),
    "drivers.sim.wire.simulator": ("BoardOptions", "Setting", "Simulator"),
    "surface.export.exporter": ("API", "Exporter"),
    "controller.base.parameters": ("PARAMETERS", "Parameters"),
    "controller.client": ("AsyncFace", "Face", "FaceError"),
    "controller.formats.format": ("API", "Format"),
    "controller.formats.frame": ("Decoder", "Encoder", "Frame", "Refusals"),
    "controller.layers.commands": ("CommandSink",),
    "controller.links.kind": ("API", "LinkContext", "Link", "LinkKind"),
    "controller.links.net.kinds": ("link_of",),
    "controller.robot.linkages.kind": ("API", "LinkageKind", "LinkageSettings"),
    "controller.takes.livelink": ("Take",),
    "controller.testing.head": ("RobotHead",),
    "controller.testing.host": ("ScriptedHost",),
    "controller.takes.reader": ("API", "TakeReader"),
}
"""Names of other modules that plug-ins and programs use."""

ERRORS = ("surface.base.errors", "drivers.base.errors", "controller.base.errors")
"""Modules of which every error is public."""

ALSO = {("surface.deform.deformation", "Deformation"), ("surface.mesh.mesh", "Mesh")}
"""Classes that public calls give back."""

_PLAIN = (type(None), bool, int, float, str)


def lines() -> Iterator[str]:
    """Every public name, in order."""
    for name in WHOLE:
        module = import_module(name)
        for each in sorted(module.__all__):
            yield from _described(f"{name}.{each}", getattr(module, each))
    for name, names in sorted(SINGLE.items()):
        for each in sorted(names):
            yield from _described(f"{name}.{each}", getattr(import_module(name), each))
    for name, each in sorted(ALSO):
        yield from _described(f"{name}.{each}", getattr(import_module(name), each))
    for name in ERRORS:
        for each, error in sorted(vars(import_module(name)).items()):
            if isinstance(error, type) and issubclass(error, BaseException) and error.__module__ == name:
                yield f"{name}.{each}({error.__bases__[0].__name__})"
    yield from commands()


def commands() -> Iterator[str]:
    """Every command with its arguments and options."""
    from typer.main import get_command

    from controller.cli.app import make_app

    yield from _command("omote", get_command(make_app()))


def _command(name: str, command: Any) -> Iterator[str]:
    if not hasattr(command, "list_commands"):
        words = [_parameter(p) for p in command.params if p.name != "help"]
        yield " ".join([name, *words])
        return
    for each in sorted(command.list_commands(None)):
        if each in FAMILIES.kinds() and FAMILIES.package_of(each):
            continue  # what other packages add is none of ours
        yield from _command(f"{name} {each}", command.get_command(None, each))


def _parameter(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        return parameter.name.upper() if parameter.required else f"[{parameter.name.upper()}]"
    return f"[{'|'.join([*parameter.opts, *parameter.secondary_opts])}]"


def _described(name: str, thing: Any) -> Iterator[str]:
    if inspect.isclass(thing):
        yield f"class {name}{_signature(thing)}"
        yield from (f"  {line}" for line in sorted(_members(thing)))
    elif callable(thing):
        yield f"{name}{_signature(thing)}"
    else:
        yield f"{name}: {type(thing).__name__}"


def _members(thing: type) -> Iterator[str]:
    fields = {field.name for field in dataclasses.fields(thing)} if dataclasses.is_dataclass(thing) else set()
    for name in {name for each in thing.__mro__ if _is_ours(each) for name in vars(each)}:
        if name.startswith("_") or name in fields:
            continue
        member = inspect.getattr_static(thing, name)
        if isinstance(member, classmethod | staticmethod):
            yield f"{name}{_signature(getattr(thing, name))}"
        elif callable(member):
            yield f"{name}{_signature(member)}"
        else:
            yield name
    yield from fields


def _is_ours(thing: type) -> bool:
    return thing.__module__.partition(".")[0] in ("surface", "drivers", "controller")


def _signature(thing: Any) -> str:
    """Parameters with their defaults; types are left to the type checker."""
    try:
        found = inspect.signature(thing)
    except (TypeError, ValueError):
        return ""
    plain = [each.replace(annotation=each.empty, default=_default(each)) for each in found.parameters.values()]
    return str(found.replace(parameters=plain, return_annotation=found.empty))


def _default(parameter: inspect.Parameter) -> Any:
    given = parameter.default
    return given if given is parameter.empty or isinstance(given, _PLAIN) else _Other()


class _Other:
    """A default that is no plain value."""

    def __repr__(self) -> str:
        return "..."


if __name__ == "__main__":
    print("\n".join(lines()))  # noqa: T201
