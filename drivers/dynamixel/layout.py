"""Steps and radians, and where each model keeps the registers that a bus reads every cycle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from drivers.base.bus import Floats, ServoSpec
from drivers.tables.tables import ControlTable, Item

Ticks = NDArray[np.int32]

MAGNITUDE_BIT = 1024
"""XL-320: bit 10 of speed and load is the direction, the rest the magnitude."""

TRIPPED = 0xFF
"""What the watchdog's register says when it has stopped the servo."""

_EDGE = 1e-6  # steps: a limit given as a whole step must not lose it to rounding


class Scale:
    """Steps of each servo's encoder and the angles they mean; shapes ``(n,)``.

    ``shaft = (ticks - center) * rad_per_tick`` and ``shaft = zero_rad + sign * angle``.

    Parameters
    ----------
    servos : n servos.
    tables : their control tables, in the same order.

    Attributes
    ----------
    axes : (4, n): sign, zero_rad, center and rad_per_tick, which are its rows.
    low, high : where goals may lie, steps.
    lowest, highest : what the servos take as a goal at all, steps.
    """

    def __init__(self, servos: Sequence[ServoSpec], tables: Sequence[ControlTable]) -> None:
        from drivers.core.kernels import to_si, to_steps  # compiled: only who drives servos pays for it

        self._to_steps, self._to_si = to_steps, to_si
        sign = [-1.0 if servo.reverse else 1.0 for servo in servos]
        zero_rad = [servo.zero_rad for servo in servos]
        self.axes = np.array(
            [sign, zero_rad, [table.center for table in tables], [table.rad_per_tick for table in tables]], np.float64
        )
        self.sign, self.zero_rad, self.center, self.rad_per_tick = self.axes
        reach = np.array([(servo.min_rad, servo.max_rad) for servo in servos], dtype=np.float64)
        ends = [self._steps(reach[:, 0]), self._steps(reach[:, 1])]
        top = np.array([table.ticks_per_turn - 1 for table in tables])
        low = np.clip(np.ceil(np.minimum(*ends) - _EDGE), 0, top)
        high = np.clip(np.floor(np.maximum(*ends) + _EDGE), low, top)
        self._bounds = np.array([low, high, np.zeros_like(top), top], np.int32)
        self.low, self.high, self.lowest, self.highest = self._bounds

    def _steps(self, angle_rad: Floats) -> Floats:
        steps: Floats = self.center + (self.zero_rad + self.sign * angle_rad) / self.rad_per_tick
        return steps

    def ticks(self, angle_rad: Floats) -> Ticks:
        """Nearest step of each angle, not limited. ``(n,)`` finite -> ``(n,) int32``."""
        return np.rint(self._steps(angle_rad)).astype(np.int32)

    def radians(self, ticks: NDArray[np.integer] | Floats) -> Floats:
        """Angle of each step, ``(n,) -> (n,) float64``."""
        angle: Floats = self.sign * ((ticks - self.center) * self.rad_per_tick - self.zero_rad)
        return angle

    def goals(self, angle_rad: Floats, steps: Ticks) -> Floats:
        """Where the servos shall go, inside all limits; one that stands outside them is led in, not thrown in.

        Parameters
        ----------
        angle_rad : (n,) finite.
        steps : (n,) the goals before, changed to the new ones.

        Returns
        -------
        (n,) float64 : the angles of the new goals.
        """
        sent: Floats = np.empty(len(steps))
        self._to_steps(angle_rad, self.axes, self._bounds, steps, sent)
        return sent

    def measured(self, known: Floats, now_s: float) -> Floats:
        """Angles (rad), speeds and currents with the angle's sign, and ages (s), (4, n).

        Parameters
        ----------
        known : (at least 4, n): position in steps, speed, current, and when they were measured.
        """
        out: Floats = np.empty((4, known.shape[1]))
        self._to_si(known, self.axes, now_s, out)
        return out

    def narrow(self, index: int, low: int, high: int) -> None:
        """Also keep one servo inside limits that its own registers hold, outside which it takes no goal."""
        self.lowest[index], self.highest[index] = low, high
        self.low[index] = min(max(self.low[index], low), high)
        self.high[index] = max(min(self.high[index], high), self.low[index])


@dataclass(frozen=True)
class Block:
    """Registers that lie together and are read in one go.

    Parameters
    ----------
    items : by the name this driver uses for them (``"position"``, ``"velocity"``, ...).
    """

    items: Mapping[str, Item]

    @cached_property
    def address(self) -> int:
        """First address."""
        return min(item.address for item in self.items.values())

    @cached_property
    def size(self) -> int:
        """Bytes to read. Never three: that is the length of a ping's reply (see S4 in sdk.py)."""
        return max(item.end for item in self.items.values()) - self.address

    @cached_property
    def dtype(self) -> np.dtype[np.void]:
        """The block's bytes as a record."""
        return np.dtype(
            {
                "names": list(self.items),
                "formats": [f"<{'i' if item.signed else 'u'}{item.size}" for item in self.items.values()],
                "offsets": [item.address - self.address for item in self.items.values()],
                "itemsize": self.size,
            }
        )

    def decode(self, data: NDArray[np.uint8]) -> NDArray[np.void]:
        """Raw values of k servos from their replies ``(k, size)`` uint8; fields by name, shape ``(k,)``."""
        return np.ascontiguousarray(data).view(self.dtype)[:, 0]


@dataclass(frozen=True)
class Layout:
    """What the bus reads and writes of one control table; servos that share addresses share a layout.

    Attributes
    ----------
    goal : register of the target.
    feedback : block read every cycle.
    slow : blocks read in turn: all that is not in ``feedback``.
    watchdog : the watchdog's register, where the model has one.
    scales : value of one step in SI units, by name; NaN where the model has no such value.
    signed_magnitude : velocity keeps its direction in bit 10 (XL-320).
    indirect : ``feedback`` is read through pointers, which a servo forgets when it reboots.
    """

    goal: Item
    feedback: Block
    slow: tuple[Block, ...]
    watchdog: Block | None
    scales: Mapping[str, float]
    signed_magnitude: bool = False
    indirect: bool = False

    @property
    def key(self) -> tuple[object, ...]:
        """Equal for layouts whose servos can share one transaction."""
        blocks = [(block.address, block.size, tuple(block.items)) for block in (self.feedback, *self.slow)]
        return (self.goal.address, self.goal.size, *blocks)

    def speeds(self, raw: NDArray[np.integer]) -> Floats:
        """Signed steps per time of the velocity register, ``(k,) -> (k,) float64``."""
        if self.signed_magnitude:
            return np.where(raw & MAGNITUDE_BIT, -1.0, 1.0) * (raw & (MAGNITUDE_BIT - 1))
        return raw.astype(np.float64)


NAMES = {
    "position": ("Present Position",),
    "velocity": ("Present Velocity", "Present Speed"),
    "current": ("Present Current", "Present Load"),
    "torque": ("Torque Enable",),
    "hardware": ("Hardware Error Status",),
    "watchdog": ("Bus Watchdog",),
    "voltage": ("Present Input Voltage", "Present Voltage"),
    "temperature": ("Present Temperature",),
    "goal": ("Goal Position",),
    "speed_limit": ("Profile Velocity", "Moving Speed"),
    "accel_limit": ("Profile Acceleration",),
    "min_ticks": ("Min Position Limit", "CW Angle Limit"),
    "max_ticks": ("Max Position Limit", "CCW Angle Limit"),
    "min_voltage": ("Min Voltage Limit",),
    "mode": ("Operating Mode", "Control Mode"),
    "drive_mode": ("Drive Mode",),
    "return_delay": ("Return Delay Time",),
    "startup": ("Startup Configuration",),
    "status_level": ("Status Return Level",),
    "shutdown": ("Shutdown",),
}
"""This driver's short names -> the vendor's names of a register, which differ by family."""


def item_of(table: ControlTable, name: str) -> Item | None:
    """Register of a table by this driver's short name; None where the model has none."""
    return next((table[vendor] for vendor in NAMES[name] if vendor in table), None)


def _block(table: ControlTable, *names: str) -> Block | None:
    items = {name: item for name in names if (item := item_of(table, name)) is not None}
    return Block(items) if items else None


FULL = ("position", "velocity", "current")
INDIRECT = (*FULL, "temperature", "hardware", "torque", "watchdog")
"""What is read in one go where registers can be mapped side by side. The last four are what tells a servo that
forgot its pointers: it reads 0 in all of them, and no servo that answers has that (see ``Telemetry``)."""


def layout_of(table: ControlTable, feedback: str = "full", indirect: Block | None = None) -> Layout:
    """Layout of a control table.

    Parameters
    ----------
    table : the model's.
    feedback : ``"full"`` reads velocity and current with the position, ``"position"`` only the position.
    indirect : block to read instead, through pointers that were set up before.
    """
    goal = item_of(table, "goal")
    block = indirect or _block(table, *(FULL if feedback == "full" else FULL[:1]))
    if goal is None or block is None:
        raise ValueError(f"{table.model} has no goal or no present position")
    blocks = [_block(table, name) for name in ("torque", "hardware", "watchdog") if name not in block.items]
    blocks.append(_supply(table))
    return Layout(
        goal,
        block,
        tuple(block for block in blocks if block is not None),
        _block(table, "watchdog"),
        _scales(table),
        signed_magnitude=table.model == "xl320",
        indirect=indirect is not None,
    )


def _scales(table: ControlTable) -> dict[str, float]:
    items = {name: item_of(table, name) for name in ("velocity", "current", "voltage", "temperature")}
    scales = {name: np.nan if item is None or item.unit == "" else item.scale for name, item in items.items()}
    if items["current"] is None or items["current"].unit != "A":
        scales["current"] = np.nan  # a load in per cent is no current
    return scales


def _supply(table: ControlTable) -> Block | None:
    """Voltage and temperature; with the item before them where both alone would be three bytes."""
    block = _block(table, "voltage", "temperature")
    before = table.get("Position Trajectory")
    if block is None or block.size != 3 or before is None:
        return block
    return Block({"trajectory": before, **block.items})
