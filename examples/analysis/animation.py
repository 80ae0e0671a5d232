"""An animation of a run beside its energies.

    warp-eulsph run examples/cases/bending_column.toml -o runs/column
    python examples/analysis/animation.py runs/column --field von_mises

Draws every frame, coloured by a field, beside the energies until then, as an animated GIF (``animation.gif``, in the
run's directory). ``warp-eulsph plot RUN -o film.gif`` draws the particles alone.
"""

import argparse
from pathlib import Path

import numpy as np

from warp_eulsph.output import Run
from warp_eulsph.pictures import Picture, draw_frame, fitted

ENERGIES = ("kinetic", "stored", "total")


def main(argv: list[str] | None = None) -> Path:
    """Draw; the path of the film."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, help="directory of a run")
    parser.add_argument("--field", default="velocity", help="what colours the particles")
    parser.add_argument("--fps", type=float, default=10.0, help="frames per second")
    args = parser.parse_args(argv)
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.animation import FuncAnimation, PillowWriter

    run = Run(args.run)
    log = run.log
    look = fitted(Picture(field=args.field, size=(600, 500)), run)
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 5), width_ratios=(6, 5), layout="constrained")
    left.axis("off")
    image = left.imshow(np.zeros((500, 600, 3), dtype=np.uint8))
    lines = [right.plot([], [], label=name)[0] for name in ENERGIES]
    top = max(log[name].max() for name in ENERGIES)
    right.set(xlim=(log["t"][0], log["t"][-1]), ylim=(-0.02 * top, 1.05 * top), xlabel="time [s]", ylabel="energy [J]")
    right.legend(loc="center left")

    def show(k: int) -> None:
        frame = run[k]
        image.set_data(draw_frame(frame, look))
        past = log["t"] <= frame.time
        for line, name in zip(lines, ENERGIES, strict=True):
            line.set_data(log["t"][past], log[name][past])

    path = args.run / "animation.gif"
    FuncAnimation(figure, show, frames=len(run), init_func=lambda: None).save(path, writer=PillowWriter(fps=args.fps))
    plt.close(figure)
    print(path)
    return path


if __name__ == "__main__":
    main()
