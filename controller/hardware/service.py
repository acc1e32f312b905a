"""``omote service``: writes udev rules and a systemd unit that start a head when its computer boots; installs nothing.

Sources: udev(7), systemd.unit(5), systemd.service(5), systemd.exec(5).
"""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tomli_w

from controller.base.config import read_toml
from controller.base.errors import ConfigError, ControllerError
from controller.base.files import replacing
from controller.base.parameters import PARAMETERS
from controller.base.paths import find_config
from controller.robot.buses import BusSettings
from controller.robot.robot import load_robot
from controller.robot.settings import RobotSettings
from controller.stage.stage import load_stage
from controller.tools.file_kinds import ROBOT, kind_of
from drivers.core.registry import SIMULATED
from drivers.port.latency import latency_rule
from drivers.port.ports import list_ports

GROUP = "dialout"
WATCHDOG_S, STOP_S, START_S = 10, 45, 90
"""systemd's time limits in s: without a watchdog message, for stopping, and for starting."""
_BY_ID = re.compile(r"/dev/serial/by-id/usb-(?P<serial>.+?)-if\d+")
_SERIAL = re.compile(r"[\w.:+-]+")
_NAME = re.compile(r"[^a-z0-9]+")


@dataclass(frozen=True)
class Adapter:
    """The serial adapter of one bus. bus, port : as in the robot file. serial_number : empty if unknown.

    link : device name that the udev rule gives it.
    """

    robot: str
    bus: str
    port: str
    serial_number: str
    link: str


def write_service(what: str, folder: Path, user: str, name: str = "") -> tuple[list[Path], list[str]]:
    """Write the files for a stage or a robot; return their paths and the commands that install them.

    what : a stage or a robot, as for ``omote check``. user : account that runs the service. name : of the service.

    Raises ConfigError: it cannot be read. ControllerError: a name that systemd does not take, or no room to write.
    """
    stage, robots, title = _stage_and_robots(what)
    short = _plain(name or title)
    if not re.fullmatch(r"[a-z_][a-z0-9_-]{0,31}", user):
        raise ControllerError(f"{user!r} is no user name", hint="--user omote")
    adapters = [
        _adapter(robot, bus, short)
        for robot in robots
        for bus in robot.buses
        if bus.kind != SIMULATED and "://" not in bus.port
    ]
    files: dict[Path, str] = {}
    if stage is None:
        stage = (folder / f"{short}.stage.toml").resolve()
        files[stage] = tomli_w.dumps({"name": title, "robots": [str(_find(what).resolve())]})
    rules, unit = folder / f"99-omote-{short}.rules", folder / f"omote-{short}.service"
    if adapters:
        files[rules] = rules_text(title, adapters)
    files[unit] = unit_text(title, stage, user, adapters)
    commands = _commands(rules if adapters else None, unit, user, adapters)
    commands += [f"# leave {stage} where it is, and readable for {user}: the unit names it"]
    files[folder / "INSTALL.txt"] = "\n".join(commands) + "\n"
    for path, text in files.items():
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
            temporary.chmod(0o644)
    return list(files), commands


def _stage_and_robots(what: str) -> tuple[Path | None, Sequence[RobotSettings], str]:
    """Return the path of a stage (None for a single robot), its robots, and its name."""
    path = _find(what)
    if kind_of(read_toml(path)) is ROBOT:
        robot = load_robot(path, PARAMETERS)
        return None, [robot], robot.name
    stage = load_stage(str(path), PARAMETERS)
    if not stage.robots:
        raise ConfigError(f"{stage.path}: robots: a stage without a robot needs no service")
    return stage.path.resolve(), stage.robots, stage.settings.name


def _find(what: str) -> Path:
    try:
        return find_config("stages", what)
    except ConfigError:
        return find_config("robots", what)


def _plain(title: str) -> str:
    """Convert a title to a name for files and units."""
    plain = _NAME.sub("-", title.lower()).strip("-")
    if not plain:
        raise ControllerError(f"{title!r} gives no name for a service", hint="--name head")
    return plain


def _adapter(robot: RobotSettings, bus: BusSettings, short: str) -> Adapter:
    return Adapter(robot.name, bus.name, bus.port, _serial_of(bus.port), f"omote-{short}-{_plain(bus.name)}")


def _serial_of(port: str) -> str:
    """Serial number of a port's adapter: of the connected device, or from its name in by-id; empty if unknown."""
    for record in list_ports():
        if port in (record.device, record.by_id) and _SERIAL.fullmatch(record.serial_number):
            return record.serial_number
    named = _BY_ID.match(port)
    return named["serial"].rpartition("_")[2] if named else ""


# ---------------------------------------------------------------------- udev


def rules_text(title: str, adapters: Sequence[Adapter]) -> str:
    """Return udev rules that give adapters a group that may use them, a short latency timer and, where the serial
    number is known, a permanent name."""
    lines = [f"# Adapters of {title}, for omote. Into /etc/udev/rules.d; read by: sudo udevadm control --reload"]
    for adapter in adapters:
        lines += ["", f"# bus {adapter.bus} of {adapter.robot}"]
        rules = []
        if adapter.serial_number:
            match = f'SUBSYSTEM=="tty", ATTRS{{serial}}=="{adapter.serial_number}"'
            rules.append(f'{match}, SYMLINK+="{adapter.link}", GROUP="{GROUP}", MODE="0660", TAG+="systemd"')
        else:
            lines.append(f"# {adapter.port}: its serial number is not known, so it has no name of its own.")
            rules.append(f'SUBSYSTEM=="tty", SUBSYSTEMS=="usb", GROUP="{GROUP}", MODE="0660"')
        rules.append(latency_rule(adapter.serial_number))
        lines += [rule for rule in rules if rule not in lines]  # adapters without a number share theirs
    return "\n".join(lines) + "\n"


# ---------------------------------------------------------------------- systemd

UNIT = """\
# Starts {title} with the computer, by omote. Into /etc/systemd/system.
[Unit]
Description=omote: {title}
{after}
StartLimitIntervalSec=300
StartLimitBurst=5

[Service]
Type=notify
NotifyAccess=main
ExecStart={command}
Restart=on-failure
RestartSec=5

# SIGTERM brings the servos to rest and switches them off; processes that still run after this time are killed, and
# then servos with a bus watchdog stop by themselves.
KillMode=mixed
KillSignal=SIGTERM
TimeoutStartSec={start}
TimeoutStopSec={stop}
# A program that gives no sign of life is ended as above and started again.
WatchdogSec={watchdog}
WatchdogSignal=SIGTERM

User={user}
SupplementaryGroups={group}
# Compiled code that omote keeps; real-time scheduling for the servos.
CacheDirectory=omote
Environment=XDG_CACHE_HOME=%C/omote NUMBA_CACHE_DIR=%C/omote/numba
LimitRTPRIO=20

# Of devices only serial ports and pseudo-terminals. MemoryDenyWriteExecute would forbid compiled code.
DevicePolicy=closed
DeviceAllow=char-ttyUSB rw
DeviceAllow=char-ttyACM rw
DeviceAllow=char-ttyAMA rw
DeviceAllow=char-ttyS rw
DeviceAllow=char-pts rw
DeviceAllow=/dev/ptmx rw
NoNewPrivileges=yes
CapabilityBoundingSet=
ProtectSystem=strict
ProtectHome=read-only
PrivateTmp=yes
ProtectClock=yes
ProtectHostname=yes
ProtectKernelTunables=yes
ProtectKernelModules=yes
ProtectKernelLogs=yes
ProtectControlGroups=yes
RestrictNamespaces=yes
RestrictSUIDSGID=yes
RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_NETLINK
LockPersonality=yes
SystemCallArchitectures=native
SystemCallFilter=@system-service
UMask=0077

[Install]
WantedBy=multi-user.target
"""


def unit_text(title: str, stage: Path, user: str, adapters: Sequence[Adapter]) -> str:
    """systemd unit that runs a stage; it waits for the adapters that have a name by a rule."""
    devices = " ".join(_device_unit(adapter.link) for adapter in adapters if adapter.serial_number)
    after = f"Wants={devices}\nAfter={devices}" if devices else "After=systemd-udevd.service"
    command = " ".join(_quoted(word) for word in (*_omote(), "run", str(stage), "--no-face"))
    return UNIT.format(
        title=title.replace("%", "%%").replace("\n", " "), after=after, command=command, user=user, group=GROUP,
        start=START_S, stop=STOP_S, watchdog=WATCHDOG_S,
    )  # fmt: skip


def _omote() -> tuple[str, ...]:
    """Return the command that runs omote: beside the interpreter, else on PATH, else through the interpreter."""
    beside = Path(sys.executable).with_name("omote")
    found = str(beside) if beside.is_file() else shutil.which("omote")
    return (found,) if found else (sys.executable, "-c", "from controller.cli.app import main; main()")


def _quoted(word: str) -> str:
    """Quote a word of a command line for systemd.service(5)."""
    plain = word.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%").replace("$", "$$")
    return plain if re.fullmatch(r"[\w./:@=+-]+", plain) else f'"{plain}"'


def _device_unit(link: str) -> str:
    """Name of the unit of a device, escaped as by systemd-escape(1)."""
    path = f"dev/{link}"
    escaped = "".join(
        c if re.fullmatch(r"[A-Za-z0-9:_.]", c) else "-" if c == "/" else f"\\x{ord(c):02x}" for c in path
    )
    return f"{escaped}.device"


def _commands(rules: Path | None, unit: Path, user: str, adapters: Sequence[Adapter]) -> list[str]:
    lines = [f"sudo useradd --system --groups {GROUP} {user}"]
    if rules is not None:
        lines.append(f"sudo cp {rules} /etc/udev/rules.d/")
        lines.append("sudo udevadm control --reload && sudo udevadm trigger --subsystem-match=tty")
        lines.append("sudo udevadm trigger --subsystem-match=usb-serial")
    for adapter in adapters:
        if adapter.serial_number and adapter.port != f"/dev/{adapter.link}":
            lines.append(f'# in the file of {adapter.robot}, bus {adapter.bus}: port = "/dev/{adapter.link}"')
        elif not adapter.serial_number:
            lines.append(f"# plug in the adapter of {adapter.bus} ({adapter.port}) and write these files again")
    lines.append(f"sudo cp {unit} /etc/systemd/system/ && sudo systemctl daemon-reload")
    lines.append(f"sudo systemctl enable --now {unit.name}")
    return lines
