"""Exceptions of the drivers: one tree below :class:`DriverError`, each with message, hint, port and servo ids."""

from __future__ import annotations

from collections.abc import Mapping


class DriverError(Exception):
    """Something that a driver cannot do.

    message : what failed, on which port and servo, and why.
    hint : the next thing to type or do; may be empty.
    port : device path, where one is concerned.
    servo_ids : ids of the servos concerned.
    """

    def __init__(
        self, message: str, *, hint: str = "", port: str | None = None, servo_ids: tuple[int, ...] = ()
    ) -> None:
        super().__init__(message)
        self.hint = hint
        self.port = port
        self.servo_ids = servo_ids


class PluginError(DriverError):
    """A plug-in, such as a kind of bus or link, that is not installed or cannot be loaded."""


class PortError(DriverError):
    """The operating system's serial device cannot be used."""


class PortMissing(PortError):
    """No such device: unplugged, renamed, or a wrong name in the configuration."""


class PortBusy(PortError):
    """Another program holds the device."""


class PortPermission(PortError):
    """The user may not open the device."""


class PortLost(PortError):
    """The device went away while it was in use."""


class BusError(DriverError):
    """The bus at an open port does not work as it should."""


class NoReply(BusError):
    """A servo did not answer in time."""


class CorruptReply(BusError):
    """An answer failed its checks: CRC, id or length."""


class WrongModel(BusError):
    """The servo at an id is not the configured model."""


class ServoRefused(BusError):
    """A servo answered with an error number."""


class ServoFault(BusError):
    """A servo latched a hardware error and needs a reboot."""


def merge_errors(failed: Mapping[int, BusError]) -> BusError:
    """Merge errors, by servo id, into one: class, message and hint of the first error, and the ids of all servos."""
    first, *others = {id(error): error for error in failed.values()}.values()  # one error may concern several
    if not others:
        return first
    ids = tuple(sorted(failed))
    message = f"{first}; the same or worse for {len(ids)} servos: ids {', '.join(map(str, ids))}"
    return type(first)(message, hint=first.hint, port=first.port, servo_ids=ids)
