"""Where a run took place: versions, device, precision. Equal bits are promised where these are equal."""

import platform
from pathlib import Path
from typing import Any

from .recorded import Recorded


def environment(simulation: Recorded) -> dict[str, Any]:
    """Versions, device and precision of this process and ``simulation``, as JSON takes them."""
    from importlib import metadata  # slow to load, and the command line shows its help without

    device = simulation.device
    return {
        "versions": {
            "python": platform.python_version(),
            **{name: metadata.version(name) for name in ("warp-eulsph", "warp-lang", "numpy", "h5py")},
        },
        "device": {
            "name": device.name if device.is_cuda else _processor(),
            "kind": "cuda" if device.is_cuda else "cpu",
        },
        "simd": simulation.configuration.simd,  # SIMD kernels differ from the portable ones by round-off
        "machine": {"system": platform.system(), "architecture": platform.machine()},
        "dtype": simulation.space.real.__name__,
    }


def _processor() -> str:
    """Model of the processor, for which kernels are compiled."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:  # not Linux
        return platform.processor()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor())
