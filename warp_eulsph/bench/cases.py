"""The benchmark cases: a jittered block, spinning and waving, of rubber in every mode and of water, by its defaults."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import warp as wp

from ..geometry import box
from ..materials import J2, LinearHardening, Material, NeoHookean, TaitLiquid
from ..scheme.arrangement import Current
from ..scheme.policy import Always, Every, Never, ReferencePolicy
from ..simulation import Body, Simulation

STEPS_PER_REFRESH = 10  # of the mode every_k
MODES: dict[str, ReferencePolicy] = {"total": Never(), "every_k": Every(STEPS_PER_REFRESH), "eulerian": Always()}
#: Of the stiffness of the rubber, yielding all over once it moves: what plasticity costs.
METAL = J2(density=1100.0, young=17e6, poisson=0.45, hardening=LinearHardening(yield_stress=1e4, modulus=1e5))
#: Stiffer and stronger, so that strains are those of metals, and does not yield.
HARD_METAL = J2(density=1100.0, young=17e9, poisson=0.45, hardening=LinearHardening(yield_stress=1e9))
#: With free surfaces, by the defaults of liquids.
WATER = TaitLiquid(density=1000.0, sound_speed=100.0)
DTYPES = {"float32": wp.float32, "float64": wp.float64}


@dataclass(frozen=True)
class BenchCase:
    """One problem to time.

    Args:
        name: as ``-k`` selects it.
        dim: dimension.
        dtype: "float32" or "float64".
        mode: "total", "every_k" (refreshed every tenth step) or "eulerian"; the arrangement is the current one.
        side: particles along each axis.
        threads: threads on the CPU.
        order: of the particles in memory: that of the lattice, "shuffled", or shuffled and "sorted" by the simulation.
        material: law of the block.
    """

    name: str
    dim: int
    dtype: str
    mode: str
    side: int
    threads: int = 1
    order: str = "lattice"
    material: Material = NeoHookean(density=1100.0, young=17e6, poisson=0.45)

    def build(self) -> Simulation:
        """The block: lattice with a jitter of a tenth of the spacing, 74 neighbours in 3-D, far from rest."""
        x, volume = box((0.0,) * self.dim, (1.0,) * self.dim, 1.0 / self.side)
        rng = np.random.default_rng(0)
        x = x + rng.uniform(-0.1, 0.1, x.shape) / self.side
        if self.order != "lattice":
            rng.shuffle(x)
        velocity = np.zeros_like(x)
        velocity[:, -1] = 10.0 * np.sin(3.0 * x[:, 0])
        if self.dim > 1:
            velocity[:, 0] -= 10.0 * x[:, 1]
            velocity[:, 1] += 10.0 * x[:, 0]
        body = Body(x=x, volume=volume, spacing=1.0 / self.side, material=self.material, velocity=velocity)
        return Simulation(
            body,
            reference=MODES[self.mode],
            arrangement=Current(),
            dtype=DTYPES[self.dtype],
            sort=self.order != "shuffled",
        )


def _all() -> Iterator[BenchCase]:
    for mode in MODES:
        for dtype in DTYPES:
            for dim, side in ((1, 20_000), (2, 224), (3, 37)):
                yield BenchCase(f"{mode}-{dim}d-{dtype}", dim, dtype, mode, side)
    for dtype in DTYPES:
        for dim, side in ((2, 150), (3, 30)):
            yield BenchCase(f"liquid-{dim}d-{dtype}", dim, dtype, "eulerian", side, material=WATER)
    for mode in ("total", "eulerian"):
        for dtype in DTYPES:
            yield BenchCase(f"{mode}-3d-{dtype}-2-threads", 3, dtype, mode, 37, threads=2)
            yield BenchCase(f"{mode}-3d-{dtype}-yielding", 3, dtype, mode, 37, material=METAL)
        if mode == "total":
            for dtype in DTYPES:
                yield BenchCase(f"{mode}-3d-{dtype}-unyielding", 3, dtype, mode, 37, material=HARD_METAL)
        for size, side in (("10k", 22), ("100k", 46), ("400k", 74), ("1M", 100)):
            yield BenchCase(f"{mode}-3d-float64-{size}", 3, "float64", mode, side)
        for order in ("shuffled", "sorted"):
            yield BenchCase(f"{mode}-3d-float64-{order}", 3, "float64", mode, 74, order=order)
    yield BenchCase("small-1d-float64", 1, "float64", "total", 40)
    yield BenchCase("small-1d-float64-eulerian", 1, "float64", "eulerian", 40)


CASES = tuple(_all())
