"""Measured copper rods on a wall: a law fitted to one of them, in ``..rods``, and what it says of two others.

The fitted one is matched in length and outline but for its foot, which in the shots was held back by friction. The
others are of other copper, softer and one of them hot: what is predicted of them is as wrong as taking all copper for
one is. By the published law of its own copper, OFHC, with nothing fitted, rod 1 is matched too.
"""

from collections.abc import Sequence

from ..case import Case
from ..report import Figure
from ..rods import LAW, OFHC, compare, measured

#: Rod, kind and law -> accepted errors of length and of the outline (root mean square).
BANDS = {
    ("5", "fitted", LAW): (0.02, 0.025),
    ("1", "predicted", LAW): (0.12, 0.14),
    ("2", "predicted", LAW): (0.15, 0.18),
    ("1", "published", OFHC): (0.02, 0.04),
}


def run(quick: bool) -> Sequence[Figure]:
    """By 4 particles per radius, as it was fitted; quick: rod 5 by 3, where the outline is half as good."""
    figures = []
    for (name, kind, law), (length, radii) in BANDS.items():
        if quick and name != "5":
            continue
        radii *= 2.0 if quick else 1.0
        found, _ = compare(measured()[name], law, 3 if quick else 4)
        figures += [
            Figure(f"rod_{name}_{kind}_length_error", found["length"], -length, length, 0.0),
            Figure(f"rod_{name}_{kind}_outline_error", found["radii"], 0.0, radii, 0.0),
            Figure(f"rod_{name}_{kind}_foot_error", found["foot"], reference=0.0),
            Figure(f"rod_{name}_{kind}_still_moving", found["moving"], 0.0, 0.005, 0.0),
        ]
    return figures


CASE = Case(
    name="measured_rods",
    title="Copper rods on a wall as measured: one fitted, two predicted",
    source="recovered specimens (Zelepugin, Cherepanov, Pakhnutova 2023, CC BY 4.0)",
    run=run,
)
