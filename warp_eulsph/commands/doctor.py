"""``warp-eulsph doctor``: what is installed, what there is to compute on, and how fast it is."""

import argparse
import platform
import time
from importlib import metadata

# What the package needs, and what its extras bring.
NEEDED = ("warp_eulsph", "warp-lang", "numpy", "h5py", "filelock", "tqdm", "pydantic")
EXTRAS = {"matplotlib": "viz", "pyvista": "viz", "meshio": "mesh", "trimesh": "mesh", "manifold3d": "mesh"}
EXTRAS |= {"xarray": "xarray", "shtab": "completion"}

# The block that is timed: 3-D, of so many particles along a side, for so many steps after one that compiles.
SIDE, STEPS = 16, 20
# What docs/performance.md has of this block, on two cores [particle-steps/s]; nothing of GPUs
RECORDED = 0.9e6


def add(commands: argparse._SubParsersAction) -> None:
    """Describe the subcommand."""
    parser = commands.add_parser(
        "doctor",
        help="versions, devices, caches, and the speed of this machine",
        description="Say which versions are installed, which devices there are and where compiled kernels are kept; "
        "time a small block on each device, to be set beside docs/performance.md. Exit status: 0 all is there, 1 a "
        "package that is needed is not, or the block's energy is not accounted for.",
    )
    parser.add_argument("--no-speed", action="store_true", help="time nothing, compile nothing")
    parser.set_defaults(run_command=run)


def run(arguments: argparse.Namespace) -> int:
    """Print; 0, or 1 when something is wrong."""
    good = True
    print(f"{'python':14} {platform.python_version()} on {platform.system()} {platform.machine()}")
    for name in NEEDED:
        good &= _version(name, "needed: pip install warp_eulsph")
    for name, extra in EXTRAS.items():
        _version(name, f"not there: pip install 'warp_eulsph[{extra}]'")
    import warp as wp

    from ..execution import threads

    devices = wp.get_devices()
    print(f"{'kernel cache':14} {wp.config.kernel_cache_dir}")
    for device in devices:
        kind = (
            f"{threads()} threads (WARP_EULSPH_THREADS)" if device.is_cpu else f"{device.total_memory / 2**30:.0f} GiB"
        )
        print(f"{'device ' + device.alias:14} {device.name}, {kind}")
    if not any(device.is_cuda for device in devices):
        print(f"{'':14} no GPU that Warp can use: runs take the CPU")
    if not arguments.no_speed:
        for device in devices:
            speed, residual = _timed(device)
            print(f"{'speed ' + device.alias:14} {speed:.3g} particle-steps/s, float64, Eulerian, {SIDE}³ particles")
            if wp.get_device(device).is_cpu:
                print(f"{'':14} {speed / RECORDED:.2g} of what docs/performance.md has of two cores, {RECORDED:.1g}")
            if residual > 1e-10:
                good = False
                print(
                    f"{'':14} WRONG: {residual:.1e} of the energy is not accounted for; results are not to be trusted"
                )
    print("all is well" if good else "something is wrong, see above")
    return 0 if good else 1


def _version(name: str, otherwise: str) -> bool:
    try:
        found: str | None = metadata.version(name)
    except metadata.PackageNotFoundError:
        found = None
    print(f"{name:14} {found or otherwise}")
    return found is not None


def _timed(device: object) -> tuple[float, float]:
    """Particle-steps per second, and the part of a spinning block's energy that no account explains."""
    import numpy as np

    from .. import Body, NeoHookean, Simulation
    from ..geometry import box

    x, volume = box((-0.5,) * 3, (0.5,) * 3, 1.0 / SIDE)
    spin = 50.0 * np.stack([-x[:, 1], x[:, 0], np.zeros(len(x))], axis=1)
    rubber = NeoHookean(density=1100.0, young=17e6, poisson=0.45)
    simulation = Simulation(Body(x=x, volume=volume, material=rubber, velocity=spin), device=device)
    simulation.step(2)
    began = time.perf_counter()
    simulation.step(STEPS)
    energy = simulation.energy()  # which waits for the device
    return len(x) * STEPS / (time.perf_counter() - began), abs(energy["residual"]) / energy["total"]
