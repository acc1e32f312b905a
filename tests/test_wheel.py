"""omote as users get it: a wheel, installed away from the checkout, started from another folder."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from drivers.sim import SimulatedBus
from tests.drivers.core.test_dead_man_switch import PROGRAM, torque_after_kill

ROOMS = ("controller", "surface", "drivers")
LIMIT_S = 240.0  # kernels that the checkout has not compiled are compiled here
DEPENDENCIES = sysconfig.get_path("purelib")

pytestmark = [pytest.mark.slow, pytest.mark.skipif(os.name != "posix", reason="installs into a POSIX layout")]


@dataclass(frozen=True)
class Installed:
    """A wheel and where it is installed.

    Attributes
    ----------
    wheel : the file. python : interpreter of the environment. packages : where its code is. away : a folder to start
        programs from, which is also their home.
    """

    wheel: Path
    python: Path
    packages: Path
    away: Path

    @property
    def environment(self) -> dict[str, str]:
        """What a program gets of the tests' environment: next to nothing."""
        return {"HOME": str(self.away), "PATH": os.environ["PATH"]}

    def run(self, *words: str, **more: str) -> subprocess.CompletedProcess[str]:
        """Run Python of the environment; ``more`` are environment variables."""
        return subprocess.run(
            [str(self.python), *words],
            cwd=self.away,
            env=self.environment | more,
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
        )

    def omote(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Run the command as it was installed."""
        return self.run(str(self.python.with_name("omote")), *words)


@pytest.fixture(scope="module")
def installed(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """A wheel of this checkout in an environment that shares nothing with it but the dependencies."""
    folder = tmp_path_factory.mktemp("wheel")
    done = subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)],
        cwd=root,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    (wheel,) = folder.glob("*.whl")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder / "environment")], check=True)
    python = folder / "environment" / "bin" / "python"
    packages = Path(
        subprocess.check_output(
            [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"], text=True
        ).strip()
    )
    install(wheel, python=python)
    (packages / "dependencies.pth").write_text(DEPENDENCIES + "\n")  # its own .pth files are not followed
    take_kernels(root, packages)
    (folder / "away").mkdir()
    return Installed(wheel, python, packages, folder / "away")


def install(wheel: Path, *words: str, python: Path = Path(sys.executable)) -> None:
    """Install a wheel without what it depends on, by whichever installer there is."""
    if importlib.util.find_spec("pip"):
        command = [sys.executable, "-m", "pip", "--python", str(python), "--disable-pip-version-check"]
        last = ["--no-compile", "--no-warn-script-location", "--ignore-installed"]  # this environment's omote stays
    elif uv := shutil.which("uv"):
        command, last = [uv, "pip"], ["--python", str(python), "--offline"]
    else:
        pytest.skip("needs pip or uv to install a wheel")
    command += ["install", "--quiet", "--no-deps", "--no-index", *last, *words, str(wheel)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def take_kernels(root: Path, packages: Path) -> None:
    """Take over what numba compiled in the checkout, of files that are the same; it would take most of a minute.

    Numba knows a file by its size and time.
    """
    for compiled in (path for room in ROOMS for path in (root / room).rglob("__pycache__/*.nb[ic]")):
        source = compiled.parent.parent / f"{compiled.name.partition('.')[0]}.py"
        copy = packages / source.relative_to(root)
        if copy.exists() and source.exists() and copy.read_bytes() == source.read_bytes():
            times = source.stat()
            os.utime(copy, ns=(times.st_atime_ns, times.st_mtime_ns))
            (copy.parent / "__pycache__").mkdir(exist_ok=True)
            shutil.copy2(compiled, copy.parent / "__pycache__")


# ---------------------------------------------------------------------------- what is in it


def test_every_file_of_the_rooms_and_configs_is_in_the_wheel(installed: Installed, root: Path) -> None:
    listing = None
    if shutil.which("git"):
        listing = subprocess.run(["git", "ls-files", "-z", *ROOMS, "configs"], cwd=root, capture_output=True, text=True)
    if listing is None or listing.returncode:
        pytest.skip("needs git and a repository, to know which files there are")
    tracked = {name for name in listing.stdout.split("\0") if name and (root / name).exists()}
    assert len(tracked) > 300
    assert {Path(name).suffix for name in tracked} >= {".py", ".toml", ".npz"}
    held = {
        name.partition(".data/data/share/omote/")[2] or name for name in zipfile.ZipFile(installed.wheel).namelist()
    }
    assert tracked - held == set()


def test_nothing_but_the_rooms_and_configs_is_installed(installed: Installed) -> None:
    names = zipfile.ZipFile(installed.wheel).namelist()
    assert {name.split("/")[0].partition("-")[0] for name in names} == {*ROOMS, "omote"}
    assert [name for name in names if "__pycache__" in name or "/test_" in name] == []


def test_pytest_has_the_fixtures(installed: Installed) -> None:
    """pytest also rewrites the assertions of a package that has a plug-in."""
    test = "def test_it(servo_bus):\n    bus = servo_bus('xl330-m288', [1])\n    bus.no_jump()\n"
    (installed.away / "test_mine.py").write_text(test)
    words = ("-m", "pytest", "-q", "-p", "no:hypothesispytest", "-p", "no:cacheprovider", "test_mine.py")
    done = installed.run(*words)
    assert done.returncode == 0 and "1 passed" in done.stdout, done.stdout + done.stderr


def test_code_and_configs_come_from_the_environment(installed: Installed, root: Path) -> None:
    code = (
        "import surface, controller, drivers; print(surface.__file__, controller.__file__, drivers.__file__, sep='\\n')"
    )
    for file in installed.run("-c", code).stdout.splitlines():
        assert Path(file).is_relative_to(installed.packages)
    found = installed.run("-c", "import sys; print(*sys.path)").stdout
    assert str(root) not in found.replace(DEPENDENCIES, "")
    assert config_of(installed) == installed.python.parents[1] / "share" / "omote" / "configs"


def config_of(installed: Installed, **more: str) -> Path:
    """The configuration folder that a program finds; ``more`` are environment variables."""
    done = installed.run("-c", "from controller.base.paths import config_dir; print(config_dir())", **more)
    assert done.returncode == 0, done.stderr
    return Path(done.stdout.strip())


@pytest.mark.parametrize(("option", "code"), [("--target", "."), ("--prefix", None)])
def test_configs_are_found_wherever_an_installer_puts_them(
    installed: Installed, tmp_path: Path, option: str, code: str | None
) -> None:
    install(installed.wheel, option, str(tmp_path / "there"))
    where = tmp_path / "there" / (code or Path(sysconfig.get_path("purelib", vars={"base": ""})).relative_to("/"))
    assert (where / "controller").is_dir()
    assert config_of(installed, PYTHONPATH=str(where)) == tmp_path / "there" / "share" / "omote" / "configs"


# ---------------------------------------------------------------------------- what it does


def test_a_robot_is_checked_on_its_head(installed: Installed) -> None:
    done = installed.omote("check", "head24-anchors")
    assert done.returncode == 0, done.stderr
    assert [line for line in done.stderr.splitlines() if not line.startswith("compiling the kernels")] == []
    assert done.stdout.startswith("robot head24-anchors: 1 buses, 24 channels: good\n")


def test_an_installation_that_cannot_be_written_keeps_compiled_code_with_the_user(
    installed: Installed, tmp_path: Path
) -> None:
    site, cache = tmp_path / "site", tmp_path / "cache"
    for room in ROOMS:
        shutil.copytree(installed.packages / room, site / room, ignore=shutil.ignore_patterns("__pycache__"))
    for folder in [path for path in site.rglob("*") if path.is_dir()]:
        (folder / "__pycache__").touch()  # a file, so that not even root can write there
    before, program = sorted(site.rglob("*")), "from controller.cli.app import main; main()"
    words = ("-c", program, "run", "demo", "--dry-run", "--seconds", "0.1")
    where = {"PYTHONPATH": str(site), "XDG_CACHE_HOME": str(cache), "COLUMNS": "60"}
    first, second = installed.run(*words, **where), installed.run(*words, **where)
    assert (first.returncode, second.returncode) == (0, 0), first.stderr + second.stderr
    assert first.stderr.startswith("compiling the kernels of controller for this machine") and second.stderr == ""
    assert list(cache.rglob("*.nbi")) and sorted(site.rglob("*")) == before


def test_a_picture_is_drawn(installed: Installed) -> None:
    done = installed.omote("render", "--size", "64x64", "-o", "picture.png")
    if "no OpenGL" in done.stderr:
        pytest.skip("needs OpenGL without a display")
    assert done.returncode == 0, done.stderr
    assert (installed.away / "picture.png").read_bytes().startswith(b"\x89PNG")


def test_a_stage_runs_with_all_its_processes(installed: Installed) -> None:
    """The body, the simulated bus and the simulated host of a link are processes of their own."""
    done = installed.omote("run", "everything", "--headless", "--seconds", "1", "--report", "report.json")
    if "no OpenGL" in done.stderr:
        pytest.skip("needs OpenGL without a display")
    assert done.returncode == 0, done.stderr
    report = json.loads((installed.away / "report.json").read_text(encoding="utf-8"))
    assert report["face"]["frames"] > 0
    assert [link["accepted"] > 0 for link in report["links"]] == [True]
    assert [(bus["bus"]["cycles"] > 0, bus["fault"]) for bus in report["buses"]] == [(True, None)]


def test_a_bus_is_simulated_until_interrupted(installed: Installed) -> None:
    command = [installed.python, installed.python.with_name("omote"), "simulate", "dynamixel", "--ids", "1-2"]
    with subprocess.Popen(
        [*command, "--link", "servos"],
        cwd=installed.away,
        env=installed.environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as child:
        try:
            assert child.stdout.readline().split() == ["ready", "servos"]
            assert (installed.away / "servos").is_symlink()
            child.send_signal(signal.SIGINT)
            assert child.wait(30) in (0, 130), child.stderr.read()
        finally:
            child.kill()
    assert not (installed.away / "servos").exists()


@pytest.fixture
def wire() -> Iterator[SimulatedBus]:
    with SimulatedBus((1, 2), model="ax-12a") as simulated:
        yield simulated


def test_after_a_kill_the_servos_are_let_go(installed: Installed, wire: SimulatedBus, tmp_path: Path) -> None:
    script = tmp_path / "programs" / "drive.py"
    script.parent.mkdir()
    script.write_text(PROGRAM)
    command = [str(installed.python), str(script), "link"]
    assert torque_after_kill(wire, tmp_path, command, env=installed.environment) == [False, False]
