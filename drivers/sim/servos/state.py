"""State of one simulated servo: registers, motor, hardware errors, bus watchdog, heat; ``device`` adds instructions.

A servo takes the time as an argument and never sleeps.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from drivers.packets.packet import ALERT, ErrorNumber
from drivers.sim.servos.drive import Drive, speed_unit
from drivers.sim.servos.drive_word import FeetechDrive, WordDrive
from drivers.sim.servos.drive_x import CURRENT, CURRENT_POSITION, EXTENDED, PWM, XDrive
from drivers.sim.servos.drive_y import YDrive
from drivers.sim.servos.plant import NO_STOPS, Plant, Skin
from drivers.sim.servos.registers import Change, Registers
from drivers.sim.wire.faults import MAX_VALUE
from drivers.tables.models import check_driven
from drivers.tables.tables import load_table

TRIPPED = 0xFF
"""Value of Bus Watchdog (98) after it has tripped."""
WATCHDOG_STEP_S = 0.02
HEALTH_PERIOD_S = 0.1
BROWN_OUT_V = 2.5
"""Supply voltage below which a servo's processor stops; it restarts when the supply is back."""
INVERTER_OFF, TURNING_ON, RUNNING, TURNING_OFF, HARDWARE_FAULT = 2, 4, 5, 6, 8
"""Controller State of Y-series servos."""
BOOT_S = 0.25
"""Time in which a servo receives nothing after a reboot."""


def same_rate(first: int, second: int) -> bool:
    """Whether two ends of a wire understand each other: their clocks may differ by 3 %."""
    return abs(first - second) <= 0.03 * second


@dataclass(slots=True)
class LastInstruction:
    """Time of the last instruction on the wire; shared by the servos of a bus."""

    at_s: float


class ServoState:
    """A servo with its control table, motor and faults, without instructions.

    Parameters
    ----------
    device_id : 0 to 252.
    model : model name or number.
    now_s : time of power-up.
    firmware : version; None = a current one.
    baud : bit rate in its Baud Rate register; for a rate the model lacks the register keeps its initial value.
    position : Present Position at power-up, ticks; None = the middle of the range.
    skin : load on the shaft.

    Attributes
    ----------
    eeprom_writes : number of writes by register name (wear).
    watchdog_ignored : keeps turning when its bus watchdog trips (330-size firmware does, in current mode).
    forced_alert : sets the alert bit without a hardware error.
    eeprom_busy_s : time in which it receives nothing after a write below ``table.eeprom_end``.
    next_health_s : when heat, supply and load are checked again.
    last_instruction : when the last instruction went over the wire; a bus gives all its servos the same object.
    on_change : called when id, secondary id or baud rate changed.
    on_write : called with (changes, time) before the items of an allowed write change.
    on_refusal : called with (address, data, why, time) for a write that is refused.
    """

    def __init__(
        self,
        device_id: int,
        model: str | int = "xl330-m288",
        *,
        now_s: float = 0.0,
        firmware: int | None = None,
        baud: int = 1_000_000,
        position: float | None = None,
        skin: Skin | None = None,
    ) -> None:
        self.table = table = load_table(model, firmware)
        check_driven(table)
        self.registers = Registers(table)
        self.registers.reset(0, table.size)
        self.eeprom_writes: Counter[str] = Counter()
        self.on_change: Callable[[], None] = lambda: None
        self.on_write: Callable[[list[Change], float], None] = lambda changes, now_s: None
        self.on_refusal: Callable[[int, bytes, ErrorNumber, float], None] = lambda *_: None
        self.deaf_until = now_s
        self.watchdog_ignored = self.forced_alert = self.shut_down = False
        self.eeprom_busy_s = 0.0
        self.last_instruction = LastInstruction(now_s)
        self.next_health_s = now_s
        self._sensed_at: float | None = None
        self._pending: list[Change] = []
        self._errors = 0
        names = ("Hardware Error Status", "Error Code")
        self._error_register = next((name for name in names if name in table), "")
        self._settled_s = math.inf  # when a Y-series servo that is switched on or off is done
        self.is_feetech = "Response Level" in table
        self._delay_at = table["Return Delay Time"].address
        self._level_at = table["Response Level" if self.is_feetech else "Status Return Level"].address
        self._permanent = bytearray()
        self.registers.put("ID", device_id)
        self.force_baud(baud, self.baud)
        start = float(table.center if position is None else position)
        top_speed = (table.top_speed or table["Velocity Limit"].initial) * speed_unit(table)
        skin = skin or Skin.for_turn(table.ticks_per_turn)
        self.plant = Plant(now_s, start, top_speed, table.voltage / 10, skin, table.play_ticks)
        kind: type[Drive] = WordDrive
        if "Goal Velocity" in table:
            kind = XDrive if "Profile Velocity" in table else FeetechDrive
        if table.error_codes:
            kind = YDrive
        self.drive = kind(self.registers, self.plant, now_s)
        self._boot(now_s)

    # ------------------------------------------------------------ settings that the bus reads
    @property
    def id(self) -> int:
        """Number on the bus."""
        return self.registers.memory[self.table["ID"].address]

    @property
    def secondary_id(self) -> int | None:
        """Second number it listens to without answering, or None."""
        item = self.table.get("Secondary(Shadow) ID")
        value = self.registers.memory[item.address] if item else 255
        return value if value <= 252 else None

    @property
    def baud(self) -> int:
        """Bit rate it listens at."""
        return self.table.baud[self.registers.get("Baud Rate")]

    @property
    def return_delay_s(self) -> float:
        """Pause before a reply."""
        return self.registers.memory[self._delay_at] * 2e-6

    @property
    def status_level(self) -> int:
        """0 answers a ping only, 1 a read too, 2 everything. (Feetech's Response Level has no 0.)"""
        return self.is_feetech + self.registers.memory[self._level_at]

    @property
    def alert(self) -> int:
        """`ALERT` while a hardware error is latched, else 0."""
        if self.forced_alert or (self.registers.get(self._error_register) if self._error_register else self._errors):
            return ALERT
        return 0

    @property
    def hardware_error(self) -> int:
        """Latched hardware errors, as bits of the model's own order."""
        return self.registers.get(self._error_register) if self._error_register else self._errors

    @hardware_error.setter
    def hardware_error(self, bits: int) -> None:
        self._errors = bits
        if self._error_register:
            self.registers.put(self._error_register, bits)

    # ------------------------------------------------------------ access for tests and tools
    @property
    def torque(self) -> bool:
        """Whether the motor is on."""
        return self.plant.powered

    @property
    def goal(self) -> int:
        """Goal Position register."""
        return self.registers.get("Goal Position")

    def position_ticks(self, now_s: float) -> int:
        """Present Position."""
        self.update(now_s)
        return self.drive.to_register(self.drive.observe(now_s)[0].position)

    def register(self, name: str, now_s: float) -> int:
        """Value of any register, up to date; KeyError where the model has none of that name."""
        self.update(now_s)
        self._sense(now_s)
        return self.registers.get(name)

    def place(self, position: float, now_s: float) -> None:
        """Move the limp shaft by hand to a Present Position.

        Raises ValueError: the motor is on and holds the shaft, or the position is further away than servos count.
        """
        if not abs(position) <= MAX_VALUE:
            raise ValueError(f"servo {self.id}: positions go from {-MAX_VALUE:.0f} to {MAX_VALUE:.0f} steps")
        if self.plant.powered:
            raise ValueError(f"servo {self.id} holds its shaft: switch its torque off before moving it by hand")
        self.plant.place(now_s, self.drive.to_shaft(round(position)))
        self._sensed_at = None

    def latch(self, bits: int, now_s: float) -> None:
        """Latch hardware errors; those in the Shutdown mask switch the motor off until a reboot."""
        registers = self.registers
        if self.table.error_codes:
            self._latch_code(bits, now_s)
            return
        self.hardware_error |= bits
        if bits & registers.get("Shutdown") and not self.shut_down:
            self.shut_down = True
            if "Torque Limit" in self.table:
                registers.put("Torque Limit", 0)
            else:
                registers.put("Torque Enable", 0)
            self._set_power(False, now_s)

    def _latch_code(self, code: int, now_s: float) -> None:
        """Y-series: the last error is its code; with some it holds the shaft, with the others it lets go."""
        registers, before = self.registers, self.hardware_error
        self.hardware_error = code
        if code != before:
            history = [registers.get(f"Error Code History {k}") for k in range(1, 16)]
            for k, value in enumerate((code, *history), 1):
                registers.put(f"Error Code History {k}", value)
        if code in self.table.holding_codes:
            registers.goals_locked |= code != self.table.error_codes["battery"]
        elif not self.shut_down:
            self.shut_down = True
            registers.put("Torque Enable", 0)
            self._set_power(False, now_s)
            self._settled_s = math.inf
            registers.put("Controller State", HARDWARE_FAULT)

    # ------------------------------------------------------------ watchdog, faults, health
    def update(self, now_s: float) -> None:
        """Check bus watchdog, heat, supply and overload up to now."""
        self.check_watchdog(now_s)
        self.settle(now_s)
        if now_s >= self.next_health_s:
            self.next_health_s = now_s + HEALTH_PERIOD_S
            self.check_health(now_s)

    def settle(self, now_s: float) -> None:
        """Y-series: the brake is open, or closed, and the motor as it was told to be."""
        if now_s >= self._settled_s:
            self._settled_s = math.inf
            self.registers.put("Controller State", RUNNING if self.plant.powered else INVERTER_OFF)

    def _begin_settling(self, on: bool, now_s: float) -> None:
        """Y-series: Brake Delay and Goal Update Delay to switch on; Safe Stop Time and Brake Delay to switch off."""
        names = ("Brake Delay", "Goal Update Delay") if on else ("Brake Delay",)
        if not on and self.plant.motion(now_s).velocity:
            names = ("Safe Stop Time", *names)
        self._settled_s = now_s + 1e-3 * sum(map(self.registers.get, names))
        self.registers.put("Controller State", TURNING_ON if on else TURNING_OFF)

    def check_watchdog(self, now_s: float) -> None:
        """Trip the bus watchdog where no instruction (for any servo) arrived within its time."""
        if not self.plant.powered or "Bus Watchdog" not in self.table:
            return
        period = self.registers.get("Bus Watchdog")
        due = self.last_instruction.at_s + period * WATCHDOG_STEP_S
        if not 0 < period < 128 or now_s <= due:
            return
        self.registers.put("Bus Watchdog", -1 if self.table.error_codes else TRIPPED)
        self.registers.goals_locked = True
        if not self._ignores_watchdog():
            self.drive.stop(due)
        if self.table.error_codes:
            self._latch_code(self.table.error_codes["watchdog"], now_s)

    def _ignores_watchdog(self) -> bool:
        small = self.table.model.startswith(("xl330", "xc330"))
        return self.watchdog_ignored or (small and self.registers.get("Operating Mode") == CURRENT)

    def change_fault(self, kind: str, value: Any, begins: bool, now_s: float) -> None:
        """Begin or end a fault of this servo; kinds as in ``drivers.sim.wire.faults``."""
        plant = self.plant
        if kind == "alert":
            self.forced_alert = begins
        elif kind == "watchdog-ignored":
            self.watchdog_ignored = begins
        elif kind == "eeprom-busy":
            self.eeprom_busy_s = value if begins else 0.0
        elif kind == "stall":
            plant.jam(now_s, begins)
        elif kind == "stops":
            plant.set_stops(now_s, value if begins else NO_STOPS)
            self._sensed_at = None
        elif kind == "weight":
            plant.weight = value if begins else 0.0
            self._sensed_at = None
        elif kind == "hw" and begins:
            self.latch(int(value), now_s)
        elif kind == "volts":
            self._supply(value if begins else self.table.voltage / 10, now_s)
        elif kind == "temp":
            plant.forced_c = value if begins else None
            self.check_health(now_s)

    def _supply(self, volts: float, now_s: float) -> None:
        """Change the supply voltage; the processor stops below `BROWN_OUT_V` and restarts above it."""
        was_off, is_off = self.deaf_until == math.inf, volts < BROWN_OUT_V
        self.plant.supply_v = volts
        if is_off and not was_off:
            self._set_power(False, now_s)
            self.deaf_until = math.inf
        elif was_off and not is_off:
            self.reboot(now_s)
        self.check_health(now_s)

    def reboot(self, now_s: float) -> None:
        """Set RAM to its initial values and clear errors; the servo receives nothing for `BOOT_S`."""
        self._boot(now_s)
        self.deaf_until = now_s + BOOT_S
        self.on_change()

    def force_baud(self, baud: int, otherwise: int = 0) -> None:
        """Set the bit rate it listens at; one that the model lacks counts as `otherwise`, or as its lowest."""
        rates = self.table.baud
        near = min(rates, key=lambda rate: abs(rate - baud))
        if not same_rate(near, baud):
            near = otherwise or min(rates)
        self.registers.put("Baud Rate", rates.index(near))

    def check_health(self, now_s: float) -> None:
        """Latch the hardware errors whose causes are present, where there is a processor to notice them."""
        if self.deaf_until == math.inf:
            return
        load = self._sense(now_s)
        self.plant.heat(now_s, load)
        bits = self.drive.hardware_errors(now_s, load)
        if bits:
            self.latch(bits, now_s)

    def _sense(self, now_s: float) -> float:
        self._sensed_at = now_s
        return self.drive.sense(now_s)

    # ------------------------------------------------------------ states
    def _set_power(self, on: bool, now_s: float) -> None:
        if self.table.error_codes and on != self.plant.powered:
            self._begin_settling(on, now_s)
        self.plant.powered = on
        self.settle(now_s)
        if self.table.lock == "torque":
            self.registers.locked = on
        if on:
            self.drive.plan(now_s)
        else:
            self.drive.coast(now_s)

    def _boot(self, now_s: float) -> None:
        """Power-up. Startup Configuration bit 0 switches the motor on at once."""
        registers = self.registers
        registers.memory[: len(self._permanent)] = self._permanent
        registers.reset_ram()
        registers.goals_locked = self.shut_down = False
        registers.locked = not self.is_feetech and self.table.lock == "Lock" and bool(registers.get("Lock"))
        self.keep_permanent(0, self.table.eeprom_end)
        self.hardware_error = 0
        self._pending = []
        self.drive.born_s = now_s
        self._set_power(False, now_s)
        if self.table.error_codes:
            self._settled_s = now_s
            self.settle(now_s)
        if self.table.protocol == 2 and "Operating Mode" in self.table:
            registers.extended = registers.get("Operating Mode") in (EXTENDED, CURRENT_POSITION)
        self._reset_goals(now_s)
        self._sensed_at = None
        startup = self.table.get("Startup Configuration")
        if startup and registers.get(startup.name) & 1:
            registers.put("Torque Enable", 1)
            self._set_power(True, now_s)

    @property
    def keeps_writes(self) -> bool:
        """Whether a write below ``table.eeprom_end`` outlasts the supply: not while Feetech's Lock is 1."""
        return not (self.is_feetech and self.registers.get("Lock"))

    def keep_permanent(self, first: int, end: int) -> None:
        """Feetech: what these permanent registers hold now is what they hold after the next power-up."""
        if self.is_feetech:
            self._permanent[first:end] = self.registers.memory[first:end]

    def _reset_goals(self, now_s: float) -> None:
        """Set Goal Position to the shaft's position, and current and PWM to their limits, or 0 in their own mode."""
        registers = self.registers
        registers.put("Goal Position", self.drive.to_register(self.plant.motion(now_s).position))
        if "Goal PWM" not in self.table or self.table.error_codes:
            return
        mode = registers.get("Operating Mode")
        registers.put("Goal Velocity", 0)
        registers.put("Goal PWM", 0 if mode == PWM else registers.get("PWM Limit"))
        if "Goal Current" in self.table:
            registers.put("Goal Current", 0 if mode == CURRENT else registers.get("Current Limit"))

    def _wrap_turns(self, now_s: float) -> None:
        """Bring the shaft's position back into one turn, and Goal Position to it."""
        self._wrap_position(now_s)
        self.registers.put("Goal Position", self.drive.to_register(self.plant.motion(now_s).position))

    def _wrap_position(self, now_s: float) -> None:
        """Bring the shaft's position back into one turn."""
        self._sensed_at = None
        turn, first = self.table.ticks_per_turn, self.table.first_step
        position = self.plant.motion(now_s).position - first
        if not 0 <= position < turn:
            self.plant.place(now_s, first + position % turn)
