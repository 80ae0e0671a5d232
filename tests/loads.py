"""Problems of loads and clamps with known outcomes; run as a program it prints the tables of docs/loads.md."""

import numpy as np
import warp as wp
from bodies import COMPRESSIBLE

import warp_eulsph as es
from warp_eulsph.geometry import Relaxation, Staggered, box, disc, sphere


def external(simulation):
    """External forces [N] at the present state by number of the particles, (n, dim)."""
    forces = wp.zeros_like(simulation.stepper.forces.external)
    for condition in simulation.conditions:
        condition.load(simulation.stepper.U, simulation.clock.fields, 0.0, forces)
    return simulation.order.by_number(forces.numpy())


def forces_of(shape, *conditions, reference=es.Never(), **options):
    """External forces [N] on a body of positions and volume ``shape`` at the start, (n, dim)."""
    body = es.Body(x=shape[0], volume=shape[1], material=COMPRESSIBLE)
    return external(es.Simulation(body, boundaries=conditions, reference=reference, **options))


def bar(n, hold, outside=0, reference=es.Never()):
    """Largest displacement of the end of a bar that begins to hang, over the exact ρ g L²/E, less 1; the energies.

    Uniaxial stress, n particles along it, held at x = 0 by ``hold(spacing)``, with ``outside`` layers beyond.
    """
    young, density, g = 1e6, 1000.0, 1.0
    x = (np.arange(-outside, n) + 0.5)[:, None] / n
    body = es.Body(x=x, volume=1.0 / n, material=es.Bar(density=density, young=young))
    simulation = es.Simulation(body, boundaries=[es.BodyForce([g]), hold(1.0 / n)], reference=reference)
    end, period = [], 4.0 / np.sqrt(young / density)
    while simulation.t < 0.75 * period:
        simulation.step()
        u = (simulation.x - x)[-2:, 0]
        end.append(1.5 * u[1] - 0.5 * u[0])
    return max(end) / (density * g / young) - 1.0, simulation.energy()


def beam(n, hold, dim=2, outside=0, reference=es.Never(), jitter=0.0):
    """Largest sag [m] of the end of a beam 5 × 1 m (× 1 m) whose weight is let go, and the energies; n across."""
    young, poisson, density, g = 1e6, 0.3, 1000.0, 0.01
    x, volume = box((-outside / n,) + (0.0,) * (dim - 1), (5.0,) + (1.0,) * (dim - 1), 1.0 / n, jitter=jitter)
    law = es.SaintVenantKirchhoff(density=density, young=young, poisson=poisson)
    body = es.Body(x=x, volume=volume, material=law)
    weight = es.BodyForce((0.0, -g, 0.0)[:dim])
    simulation = es.Simulation(body, boundaries=[weight, hold(1.0 / n)], reference=reference)
    end, sags, times = x[:, 0] > 5.0 - 1.0 / n, [], []
    while simulation.t < 4.5:  # 0.75 periods of the slender beam; shear and coarseness make it longer
        simulation.step(5)
        times.append(simulation.t)
        sags.append((x - simulation.x)[end, 1].mean())
    most = int(np.argmax(sags))
    parabola = np.polyfit(times[most - 2 : most + 3], sags[most - 2 : most + 3], 2)
    return np.polyval(parabola, -0.5 * parabola[1] / parabola[0]), simulation.energy()


def clamped(dim):
    """The plane x = 0 held."""
    return lambda spacing: es.Clamped((0.0,) * dim, (-1.0,) + (0.0,) * (dim - 1))


def inside(spacing):
    """The layer next to the plane x = 0 held."""
    return es.Fixed(lambda X: X[:, 0] < spacing)


def beyond(spacing):
    """What lies beyond the plane x = 0 held."""
    return es.Fixed(lambda X: X[:, 0] < 0.0)


def _print_faces():
    print("force over p times the face, Pressure on the outermost layer and on half of the body")
    for jitter in (0.0, 0.1, 0.2):
        for n in (6, 12):
            square = box((0, 0), (1, 1), 1 / n, jitter=jitter, seed=n)
            regions = (lambda X, n=n: X[:, 0] > 1 - 1 / n, lambda X: X[:, 0] > 0.5)
            found = [-forces_of(square, es.Pressure(1.0, region)).sum(axis=0)[0] for region in regions]
            print(f"  square of {n}², jitter {jitter}: " + ", ".join(f"1 {value - 1:+.1e}" for value in found))
    for name, options in (("cut", {}), ("relaxed", {"relaxation": Relaxation()})):
        round_bodies = [(disc((0, 0), 1, 1 / n, **options), 2.0, f"disc, {n}") for n in (10, 20)]
        round_bodies += [(sphere((0, 0, 0), 1, 1 / n, **options), np.pi, f"sphere, {n}") for n in (10, 16)]
        for shape, area, what in round_bodies:
            for n in (np.eye(shape[0].shape[1])[0], np.arange(1.0, 1.0 + shape[0].shape[1])):
                n = n / np.linalg.norm(n)
                half, cap = (
                    -forces_of(shape, es.Pressure(1.0, lambda X, n=n, c=c: X @ n > c)).sum(axis=0) @ n / area
                    for c in (0.0, 0.5)
                )
                cap /= 0.75 ** (0.5 * (len(n) - 1))
                print(f"  {what} along the radius, {name}, along {np.round(n, 2)}: half {half:.4f}, cap {cap:.4f}")
    flat = box((0, 0), (1, 0.33), 0.1, jitter=0.1, seed=3)
    force = -forces_of(flat, es.Pressure(1.0, lambda X: X[:, 1] > 0.22, normal=(0, 1))).sum(axis=0)[1]
    hexagonal = box((0, 0, 0), (1, 1, 1), 0.1, filling=Staggered())
    along = -forces_of(hexagonal, es.Pressure(1.0, lambda X: X[:, 1] > 0.89, normal=(0, 1, 0))).sum(axis=0)[1]
    print(f"  jittered cells of 0.1 × 0.11: {force:.4f}; staggered, nine layers across y: {along:.4f}")


def _print_clamps():
    print("bar under gravity, error of the largest elongation: clamped, layer inside, layer outside")
    for n in (6, 12, 24, 48):
        row = bar(n, clamped(1)), bar(n, inside), bar(n, beyond, outside=1)
        print(f"  {n:3d} {row[0][0]:+.4f} {row[1][0]:+.4f} {row[2][0]:+.4f}")
    print("sag of a beam [mm]: clamped, layer inside, one layer outside, three layers outside")
    for n in (4, 6, 8, 12, 16, 24):
        row = beam(n, clamped(2)), beam(n, inside), beam(n, beyond, outside=1), beam(n, beyond, outside=3)
        print(f"  2-D {n:3d} " + " ".join(f"{1e3 * sag:.3f}" for sag, _ in row))
    for n in (4, 6, 8, 12):
        print(f"  3-D {n:3d} {1e3 * beam(n, clamped(3), dim=3)[0]:.3f}")


if __name__ == "__main__":
    _print_faces()
    _print_clamps()
