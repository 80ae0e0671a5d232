"""Where the energy of a run went: kinetic and stored energy, and what each mechanism added or took.

    warp-eulsph run examples/cases/spinning_plate.toml -s parameters.n=16 -o runs/plate
    python examples/analysis/energy_balance.py runs/plate

Prints the final accounts as shares of the largest energy and draws the log over time (``energy_balance.png``, in the
run's directory). The residual is what no account explains: round-off, 1e-10 of the energy or less.
"""

import argparse
from pathlib import Path

import numpy as np

from warp_eulsph.output import Run

ENERGIES = ("kinetic", "stored", "total")
#: Columns of the log that are no energies.
OTHERS = ("step", "t", "dt", "momentum", "angular_momentum", "least_J", "largest_J", "speed")


def draw(log: dict[str, np.ndarray], path: Path) -> None:
    """Energies above, accounts below."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (above, below) = plt.subplots(2, 1, figsize=(9, 7), sharex=True)
    for name in ENERGIES:
        above.plot(log["t"], log[name], label=name)
    for name in log:
        if name not in (*ENERGIES, *OTHERS, "residual") and np.any(log[name]):
            below.plot(log["t"], log[name], label=name)
    above.set_ylabel("energy [J]")
    below.set(xlabel="time [s]", ylabel="added since the start [J]")
    for axes in (above, below):
        axes.legend(fontsize="small")
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Print and draw; the final accounts over the largest energy."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, help="directory of a run")
    args = parser.parse_args(argv)
    log = Run(args.run).log
    largest = max(np.abs(log[name]).max() for name in ENERGIES)
    shares = {name: float(values[-1] / largest) for name, values in log.items() if name not in OTHERS}
    for name, share in shares.items():
        print(f"{name:>14} {share:+.3e}")
    draw(log, args.run / "energy_balance.png")
    print(f"picture {args.run / 'energy_balance.png'}")
    return shares


if __name__ == "__main__":
    main()
