"""Impacted elastic bar against d'Alembert's solution (paper §6.2): total Lagrangian, Eulerian, Eulerian with limiter.

    python examples/bar.py

A steel bar, left end fixed, right end free, whose right quarter starts at 5 m/s. Prints for each form the error of the
end displacement against the exact trapezoid, its overshoot, and the energy kept; draws end displacement and velocity
(``bar.png``) and writes snapshots of the Eulerian run (open ``run.vtkhdf.series`` in ParaView). Expect the two forms
to agree, an error that halves with ``-n 80``, and the overshoot nearly gone with the limiter. Seconds on a CPU, after
some ten seconds in which the kernels are compiled once.
"""

import argparse
from pathlib import Path

import numpy as np

import warp_eulsph as es
from warp_eulsph.output import SnapshotWriter
from warp_eulsph.validation import Figure, table
from warp_eulsph.validation.cases.bar import errors, measure

LENGTH = 0.1333  # m
STEEL = es.Bar(density=7833.0, young=200e9)
LIMITED = es.LaxWendroff(limiter=es.FluxCorrectedTransport(sensor=es.DimensionlessSensor()))
RUNS = {
    "total Lagrangian": (es.Never(), es.LaxWendroff()),
    "Eulerian": (es.Always(), es.LaxWendroff(), es.Current()),  # the paper's: neighbours read anew in every step
    "Eulerian, limiter": (es.Always(), LIMITED, es.Current()),
}


def build(
    n: int, reference: es.ReferencePolicy, scheme: es.LaxWendroff, arrangement: es.Arrangement = es.Convected()
) -> es.Simulation:
    """The bar as n particles: the first one, half as large, is the wall at x = 0, the last one ends at the free end."""
    dx = LENGTH / (n - 0.5)
    x = np.arange(n) * dx
    volume = np.full(n, dx)
    volume[0] = 0.5 * dx
    moving = np.clip((x + 0.5 * dx - 0.75 * LENGTH) / dx, 0.0, 1.0)  # share of the particle in the moving quarter
    bar = es.Body(x=x[:, None], volume=volume, spacing=dx, material=STEEL, velocity=5.0 * moving[:, None])
    # h equal to the spacing: a particle sees its two neighbours, the support of the paper
    forms = {"reference": reference, "arrangement": arrangement, "scheme": scheme}
    return es.Simulation(bar, boundaries=[es.Fixed([0])], dilation=1.0, **forms)


def figures(name: str, n: int, history: dict[str, np.ndarray], residual: float) -> list[Figure]:
    """What the run is judged by; the bands are those of the benchmark, which falls at first order."""
    energy = history["energy"] / history["energy"][0]
    found, limited = errors(history), "limiter" in name
    error, overshoot = found["rms_error"], found["overshoot"]
    return [
        Figure(f"{name}: rms displacement error / amplitude", error, 0.0, 0.2 if limited else 0.14 * 40 / n, 0.0),
        Figure(f"{name}: overshoot / amplitude", overshoot, high=0.05 if limited else 0.3, reference=0.0),
        Figure(f"{name}: velocity overshoot / 5 m/s", found["velocity_overshoot"], reference=0.0),
        Figure(f"{name}: largest energy / first", energy.max(), 0.0, 1.0 + 1e-9, 1.0),
        Figure(f"{name}: energy kept", energy[-1], 0.0, 1.0, 1.0),
        Figure(f"{name}: ledger residual / energy", abs(residual) / history["energy"][0], 0.0, 1e-10, 0.0),
    ]


def draw(histories: dict[str, dict[str, np.ndarray]], path: Path) -> None:
    """End displacement and velocity over time."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (above, below) = plt.subplots(2, 1, figsize=(9, 7), sharex=True)
    for name, history in histories.items():
        above.plot(1e6 * history["t"], 1e6 * history["u"], lw=1, label=name)
        below.plot(1e6 * history["t"], history["v"], lw=1)
    exact = next(iter(histories.values()))
    above.plot(1e6 * exact["t"], 1e6 * exact["u_exact"], "k--", lw=1, label="exact")
    below.plot(1e6 * exact["t"], exact["v_exact"], "k--", lw=1)
    above.set_ylabel("end displacement [µm]")
    above.legend(ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    below.set(xlabel="time [µs]", ylabel="end velocity [m/s]")
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Run, print, draw; the checked figures by name."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=40, help="particles along the bar")
    parser.add_argument("--output", type=Path, default=Path("runs/bar"), help="directory of picture and snapshots")
    args = parser.parse_args(argv)
    histories, checked = {}, []
    for name, form in RUNS.items():
        simulation = build(args.n, *form)
        writer = SnapshotWriter(args.output) if name == "Eulerian" else None
        histories[name] = measure(simulation, writer)
        checked += figures(name, args.n, histories[name], simulation.energy()["residual"])
    draw(histories, args.output / "bar.png")
    print(table(checked))
    print(f"picture {args.output / 'bar.png'}, snapshots {args.output / 'run.vtkhdf.series'}")
    outside = [figure.name for figure in checked if not figure.accepted]
    if outside:
        raise SystemExit(f"outside the accepted band: {outside}")
    return {figure.name: figure.value for figure in checked}


if __name__ == "__main__":
    main()
