"""What works on this machine: each part is tried as it will be used, in a process of its own."""

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

_LONGEST_S = 60.0
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
    "from sensors.cameras.backend import select_backend; select_backend({backend!r});"
    "import sensors.cameras.windowless, pyrender; from OpenGL import GL;"
    "renderer = pyrender.OffscreenRenderer(8, 8); renderer._platform.make_current();"
    "print(GL.glGetString(GL.GL_VERSION).decode())"
)
_GPU = "import torch; assert torch.cuda.is_available(); print(torch.cuda.get_device_name(0))"


@dataclass(frozen=True)
class Finding:
    """One part of the machine.

    Attributes:
        name: of the part.
        works: whether it was there and did what it is for.
        found: its version or model; empty if it does not work.
        used_for: commands or options that need it.
        remedy: what to install or set, for parts that do not work.
        needed: whether `cosim run` cannot do without; of OSMesa and EGL either will do.
    """

    name: str
    works: bool
    found: str
    used_for: str
    remedy: str
    needed: bool = False

    def line(self) -> str:
        """For people."""
        if self.works:
            return f"works    {self.name}: {self.found}"
        return f"missing  {self.name}: {self.remedy} ({self.used_for})"


def examine() -> Iterator[Finding]:
    """Try part after part; each takes up to some seconds."""
    yield Finding("Python", True, f"{platform.python_version()}, cosim {_version('cosim')}", "everything", "")
    yield _tried("SUMO", _SUMO, "traffic", "pip install eclipse-sumo libsumo sumolib", needed=True)
    yield _tried("Embree", _RAYS, "LiDAR", "pip install embreex", needed=True)
    for name, backend, package in (("OSMesa", "osmesa", "libosmesa6"), ("EGL", "egl", "libegl1")):
        code = _DRAWING.format(backend=backend)
        yield _tried(name, code, f"images with backend: {backend}", f"apt-get install {package}")
    yield _installed("torch", "torch", "cosim train, detect and experiment", "training")
    yield _gpu()
    yield _installed("rerun", "rerun-sdk", "cosim view --rerun", "rerun")
    yield _installed("Dask", "distributed", "cosim run --engine dask", "cluster")
    yield _chromium()


def can_record(findings: list[Finding]) -> bool:
    """Whether `cosim run` will work: all that is needed, and one way to draw."""
    draws = any(one.works for one in findings if one.name in ("OSMesa", "EGL"))
    return draws and all(one.works for one in findings if one.needed)


def _tried(name: str, code: str, used_for: str, remedy: str, *, needed: bool = False) -> Finding:
    found = _said([sys.executable, "-c", code])
    return Finding(name, found is not None, found or "", used_for, remedy, needed)


def _installed(name: str, package: str, used_for: str, extra: str) -> Finding:
    found = _version(package)
    return Finding(name, bool(found), found, used_for, f"pip install 'cosim[{extra}]'")


def _gpu() -> Finding:
    used_for, remedy = "faster training; nothing else uses it", "a CUDA driver and a build of torch for it"
    if importlib.util.find_spec("torch") is None:
        return Finding("GPU", False, "", used_for, f"torch, and {remedy}")
    return _tried("GPU", _GPU, used_for, remedy)


def _chromium() -> Finding:
    program: Callable[[str], str | None] = shutil.which
    path = next(filter(None, map(program, _CHROMIUMS)), None)
    found = _said([path, "--version"]) if path else None
    return Finding("chromium", found is not None, found or "", "tests that open pages", "apt-get install chromium")


def _said(command: list[str]) -> str | None:
    """The last line that a program prints; None if it fails or hangs."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_LONGEST_S, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    lines = done.stdout.strip().splitlines()
    return re.sub(r"\s+", " ", lines[-1]) if lines else None


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
