"""The interactions' page of the ledger: their work on the bodies, and what they hold themselves."""

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import warp as wp

from ..execution import Launcher
from ..fields import clock_structure, structure
from ..reduce import SumOfParticles
from ..space import Space, vector_type
from ..structs import ClockArrays, ParticleArrays, StateArrays


@functools.cache
def _make_work(space: Space) -> wp.Kernel:
    """Kernel of ``SumOfParticles``: work of an interaction on the particles in this step, Δt f·v̄."""
    vec, Particles, State = space.vec, structure(space, "Particles"), structure(space, "State")
    Clock, precise, wide = clock_structure(space), vector_type(space.dim, wp.float64), wp.float64

    @wp.kernel(module="unique", enable_backward=False)
    def work(
        first: int,
        bounds: wp.array(dtype=wp.int32),
        particles: Particles,
        state: State,
        v_old: wp.array(dtype=vec),
        forces: wp.array(dtype=vec),
        clock: Clock,
        out: wp.array(dtype=wide),
    ):
        block = first + wp.tid()
        total = wide(0.0)
        for a in range(bounds[block], bounds[block + 1]):
            v_mean = wide(0.5) * (precise(v_old[a]) + precise(state.v[a]))
            total += wide(particles.share[a]) * wp.dot(precise(forces[a]), v_mean)
        out[block] = total * clock.dt[0]

    return work


@functools.cache
def _make_book_work(entry_type: Any, external: int) -> wp.Kernel:
    """Kernel: an interaction's work, which is in the entry of the external forces', to its own account."""
    wide = wp.float64

    @wp.kernel(module="unique", enable_backward=False)
    def book_work(k: int, step: wp.array(dtype=wide), works: wp.array(dtype=wide), total: wp.array(dtype=entry_type)):
        works[k] = works[k] + step[0]
        entry = total[0]
        entry[wp.static(external)] = entry[wp.static(external)] - step[0]
        total[0] = entry

    return book_work


class Exchange(NamedTuple):
    """An interaction as the ledger sees it.

    Its forces [N] on particles, (n,) of vec, the energy [J] it holds, what it put into stores of bodies beside their
    work, and what came in through it from outside.
    """

    forces: wp.array
    energy: Callable[[], float]
    passed: Callable[[], float]
    supplied: Callable[[], float]


class Exchanges:
    """Accounts of the interactions, one each."""

    def __init__(
        self,
        space: Space,
        particles: ParticleArrays,
        clock: ClockArrays,
        exchanges: Sequence[Exchange],
        device: wp.DeviceLike,
    ):
        self.space, self.particles, self.clock, self._exchanges = space, particles, clock, exchanges
        self._launch = Launcher(device)
        self._works, self._start = (wp.zeros(len(exchanges), dtype=wp.float64, device=device) for _ in range(2))
        self._step = wp.zeros(1, dtype=wp.float64, device=device)
        self._sum = SumOfParticles(wp.float64, [len(particles.mass)], device)

    def open(self) -> None:
        """Start the books."""
        self._works.zero_()
        self._start.assign([exchange.energy() for exchange in self._exchanges])

    def evolving(self) -> dict[str, wp.array]:
        """Work so far and the energies held at the start, by name."""
        return {"Exchanges.works": self._works, "Exchanges.start": self._start}

    def record(self, U: StateArrays, v_old: wp.array, total: wp.array, external: int) -> None:
        """Book a step from velocities ``v_old`` to ``U``, and take it out of entry ``external`` of the others."""
        for k, exchange in enumerate(self._exchanges):
            self._sum(_make_work(self.space), [self.particles, U, v_old, exchange.forces, self.clock], self._step)
            self._launch.once(_make_book_work(total.dtype, external), 1, [k, self._step, self._works, total])

    def held(self) -> float:
        """Energy that interactions hold [J]; reads the device."""
        return float(sum(exchange.energy() for exchange in self._exchanges))

    def accounts(self) -> list[float]:
        """Energy that each added since the start [J], with what it holds; reads the device.

        0 where its forces are those of its energy and steps are short, less where it dissipates. What was supplied
        through it is not in it.
        """
        booked = zip(self._exchanges, self._works.numpy().tolist(), self._start.numpy().tolist(), strict=True)
        return [
            work + float(exchange.passed()) + float(exchange.energy()) - start - float(exchange.supplied())
            for exchange, work, start in booked
        ]

    def supplied(self) -> float:
        """Energy that came in from outside through interactions since the start [J]; reads the device."""
        return float(sum(exchange.supplied() for exchange in self._exchanges))
