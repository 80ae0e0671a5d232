"""Where a case's energy goes: kinetic and stored energy, and what each mechanism added or took.

    python examples/analysis/energy_balance.py examples/cases/spinning_plate.toml -s parameters.n=16

Runs the case, prints the final accounts as shares of the largest energy, and draws them over time
(``energy_balance.png``). The residual is what no account explains: round-off, 1e-10 of the energy or less.
"""

import argparse
from pathlib import Path

import numpy as np
import warp as wp

from warp_eulsph.cases import read_case
from warp_eulsph.validation.history import History, record


def draw(history: History, path: Path) -> None:
    """All accounts over time; the small ones on an axis of their own."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (above, below) = plt.subplots(2, 1, figsize=(9, 7), sharex=True)
    for name, values in history.items():
        if name in ("kinetic", "stored", "total"):
            above.plot(history["t"], values, label=name)
        elif name not in ("t", "residual") and np.any(values):
            below.plot(history["t"], values, label=name)
    above.set_ylabel("energy [J]")
    below.set(xlabel="time [s]", ylabel="added since the start [J]")
    for axes in (above, below):
        axes.legend(fontsize="small")
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main(argv: list[str] | None = None) -> dict[str, float]:
    """Run, print, draw; the final accounts over the largest energy."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("case", help="case file")
    parser.add_argument("-s", "--set", action="append", default=[], metavar="KEY=VALUE", help="change an entry")
    parser.add_argument("--frames", type=int, default=100, help="times at which energies are looked at")
    parser.add_argument("--output", type=Path, default=Path("runs/energy_balance"))
    args = parser.parse_args(argv)
    wp.config.log_level = wp.LOG_WARNING
    case = read_case(args.case, args.set)
    simulation = case.build()
    history = record(simulation, np.linspace(0.0, case.until, args.frames + 1), simulation.energy)
    largest = max(np.abs(history["total"]).max(), history["kinetic"].max(), history["stored"].max())
    shares = {name: float(values[-1] / largest) for name, values in history.items() if name != "t"}
    for name, share in shares.items():
        print(f"{name:>14} {share:+.3e}")
    draw(history, args.output / "energy_balance.png")
    print(f"picture {args.output / 'energy_balance.png'}")
    return shares


if __name__ == "__main__":
    main()
