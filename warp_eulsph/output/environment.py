"""Where a run took place: versions, device, precision. Equal bits are promised where these are equal."""

import platform
from typing import Any

from ..execution import simd
from ..simulation import Simulation


def environment(simulation: Simulation) -> dict[str, Any]:
    """Versions, device and precision of this process and ``simulation``, as JSON takes them."""
    from importlib import metadata  # slow to load, and the command line shows its help without

    device = simulation.device
    return {
        "versions": {
            "python": platform.python_version(),
            **{name: metadata.version(name) for name in ("warp-eulsph", "warp-lang", "numpy", "h5py")},
        },
        "device": {"name": device.name or platform.processor(), "kind": "cuda" if device.is_cuda else "cpu"},
        "simd": simd(device),  # SIMD kernels differ from the portable ones by round-off
        "machine": {"system": platform.system(), "architecture": platform.machine()},
        "dtype": simulation.space.real.__name__,
    }
