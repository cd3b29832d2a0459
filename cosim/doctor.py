"""Check the dependencies on this machine by using each of them in a separate process."""

from __future__ import annotations

import importlib.util
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

_TIMEOUT_S = 60.0
_CHROMIUMS = ("chromium", "chromium-browser", "google-chrome")
_SUMO = (
    "import libsumo, subprocess, sumo, pathlib;"
    "program = pathlib.Path(sumo.SUMO_HOME) / 'bin' / 'sumo';"
    "subprocess.run([program, '--version'], check=True, capture_output=True);"
    "print(libsumo.getVersion()[1].removeprefix('SUMO '))"
)
_RAYS = (
    "import numpy as np; from embreex.rtcore_scene import EmbreeScene;"
    "from embreex.mesh_construction import TriangleMesh;"
    "scene = EmbreeScene(robust=True);"
    "TriangleMesh(scene, np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32));"
    "ray = np.ones((1, 3), np.float32);"
    "hit = scene.run(np.zeros((1, 3), np.float32), ray, query='INTERSECT');"
    "assert hit[0] == 0, hit; import importlib.metadata as m; print('embreex', m.version('embreex'))"
)
_DRAWING = (
    "from sensors.cameras.renderer import select_backend; select_backend({backend!r});"
    "from sensors.cameras.context import open_context; from OpenGL import GL;"
    "context = open_context(8, 8);"
    "print(GL.glGetString(GL.GL_VERSION).decode())"
)
_GPU = "import torch; assert torch.cuda.is_available(); print(torch.cuda.get_device_name(0))"


@dataclass(frozen=True)
class CheckResult:
    """Result of checking one dependency.

    Attributes:
        name: name of the dependency.
        works: whether it is installed and works.
        found: its version or model; empty if it does not work.
        used_for: commands or options that need it.
        remedy: how to install or configure it.
        needed: whether `cosim run` requires it; of OSMesa and EGL only one is required, so neither is marked.
    """

    name: str
    works: bool
    found: str
    used_for: str
    remedy: str
    needed: bool = False

    def line(self) -> str:
        """Human-readable line."""
        if self.works:
            return f"works    {self.name}: {self.found}"
        return f"missing  {self.name}: {self.remedy} ({self.used_for})"


def examine() -> Iterator[CheckResult]:
    """Check the dependencies one after another; each check takes up to a few seconds."""
    yield CheckResult("Python", True, f"{platform.python_version()}, cosim {_version('cosim')}", "everything", "")
    yield _run_check("SUMO", _SUMO, "traffic", "pip install eclipse-sumo libsumo sumolib", needed=True)
    yield _run_check("Embree", _RAYS, "LiDAR", "pip install embreex", needed=True)
    for name, backend, package in (("OSMesa", "osmesa", "libosmesa6"), ("EGL", "egl", "libegl1")):
        code = _DRAWING.format(backend=backend)
        yield _run_check(name, code, f"images with backend: {backend}", f"apt-get install {package}")
    yield _check_package("torch", "torch", "cosim train, detect and experiment", "training")
    yield _check_gpu()
    yield _check_package("rerun", "rerun-sdk", "cosim view --rerun", "rerun")
    yield _check_package("Dask", "distributed", "cosim run --engine dask", "cluster")
    yield _check_chromium()


def can_record(findings: list[CheckResult]) -> bool:
    """Whether `cosim run` works: all required dependencies and at least one OpenGL backend work."""
    has_renderer = any(finding.works for finding in findings if finding.name in ("OSMesa", "EGL"))
    return has_renderer and all(finding.works for finding in findings if finding.needed)


def _run_check(name: str, code: str, used_for: str, remedy: str, *, needed: bool = False) -> CheckResult:
    output = _last_line([sys.executable, "-c", code])
    return CheckResult(name, output is not None, output or "", used_for, remedy, needed)


def _check_package(name: str, package: str, used_for: str, extra: str) -> CheckResult:
    installed = _version(package)
    return CheckResult(name, bool(installed), installed, used_for, f"pip install 'cosim[{extra}]'")


def _check_gpu() -> CheckResult:
    used_for, remedy = "only for faster training and detection", "a CUDA driver and a build of torch for it"
    if importlib.util.find_spec("torch") is None:
        return CheckResult("GPU", False, "", used_for, f"torch, and {remedy}")
    return _run_check("GPU", _GPU, used_for, remedy)


def _check_chromium() -> CheckResult:
    program: Callable[[str], str | None] = shutil.which
    path = next(filter(None, map(program, _CHROMIUMS)), None)
    output = _last_line([path, "--version"]) if path else None
    return CheckResult(
        "chromium", output is not None, output or "", "tests that open pages", "apt-get install chromium"
    )


def _last_line(command: list[str]) -> str | None:
    """Run a program and return the last line of its output; None if it fails or does not end in time."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_TIMEOUT_S, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    lines = done.stdout.strip().splitlines()
    return re.sub(r"\s+", " ", lines[-1]) if lines else None


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
