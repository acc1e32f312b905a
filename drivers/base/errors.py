"""Errors of the drivers room.

The tree::

    DriverError
    ├── PortError            the operating system's serial device
    │   ├── PortMissing      no such device: unplugged, renamed, wrong name in the configuration
    │   ├── PortBusy         another program holds it
    │   ├── PortPermission   the user may not open it
    │   └── PortLost         it went away while in use (unplugged)
    ├── PluginError          a kind that is not installed, or a plug-in that cannot be loaded
    └── BusError             the wire behind an open port
        ├── NoReply          a servo did not answer in time
        ├── CorruptReply     an answer failed its checks (CRC, id, length)
        ├── WrongModel       the servo at an id is not the configured model
        ├── ServoRefused     a servo answered with an error number
        └── ServoFault       a servo latched a hardware error
"""

from __future__ import annotations

from collections.abc import Mapping


class DriverError(Exception):
    """Something the drivers room cannot do.

    Parameters
    ----------
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
    """A kind of bus, link or the like that is not installed, or that cannot be loaded."""


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
    """The wire behind an open port does not work as it should."""


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
    """One error for many servos: the first one's kind and hint, every servo's id, and how many there are."""
    first, *others = failed.values()
    if not others:
        return first
    ids = ", ".join(map(str, sorted(failed)))
    message = f"{first}; the same or worse for {len(failed)} servos: ids {ids}"
    return type(first)(message, hint=first.hint, port=first.port, servo_ids=tuple(sorted(failed)))
