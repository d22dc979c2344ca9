"""Where a run took place: versions, commit, processor, threads."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

_PACKAGES = ("numpy", "numba", "llvmlite", "trimesh", "OpenImageIO", "scipy", "pydantic", "ruamel.yaml", "embreex",
             "open3d")


def package_versions() -> dict[str, str]:
    """Versions of Python and of the packages that decide results; those not installed are left out."""
    versions = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    return versions


def git_state() -> dict[str, Any]:
    """Commit and dirty flag of the package's own checkout; both None when it is installed without one."""
    root = Path(__file__).parent.parent

    def git(*words: str) -> str | None:
        try:
            done = subprocess.run(["git", "-C", str(root), *words], capture_output=True, text=True, timeout=5)
        except (OSError, subprocess.TimeoutExpired):
            return None
        return done.stdout.strip() if done.returncode == 0 else None

    if git("ls-files", "--error-unmatch", "shadowbench/__init__.py") is None:
        return {"commit": None, "dirty": None}
    changes = git("status", "--porcelain", "--", "shadowbench")
    return {"commit": git("rev-parse", "HEAD"), "dirty": None if changes is None else bool(changes)}


def processor() -> dict[str, Any]:
    """Model name, number of processors that this process may use, and the features that LLVM compiles for."""
    import llvmlite.binding as llvm

    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                model = line.partition(":")[2].strip()
                break
    features = sorted(name for name, present in llvm.get_host_cpu_features().items() if present)
    return {"model": model, "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity")
            else os.cpu_count(), "llvm_cpu": os.environ.get("NUMBA_CPU_NAME") or llvm.get_host_cpu_name(),
            "features": features}
