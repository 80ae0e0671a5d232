"""Figures of the documents that are constants or defaults of the code: a page says what the code has."""

import inspect
import re
from fractions import Fraction
from pathlib import Path

import pytest

import warp_eulsph as es
from warp_eulsph import execution, simulation, sorting, transport
from warp_eulsph.defaults import COMMON, LIQUID
from warp_eulsph.geometry import surface
from warp_eulsph.output import checkpoint
from warp_eulsph.scheme import exposure, flux_kernels, lax, time_step

DOCS = Path(__file__).parents[1] / "docs"
WORDS = {2: "two", 3: "three", Fraction(1, 2): "½", Fraction(1, 10): "a tenth", 100: "a hundred"}
BOUND = Fraction(es.Shifting().bound).limit_denominator(1000)


def word(number):
    return WORDS[Fraction(number).limit_denominator(1000)]


def default(function, name):
    return inspect.signature(function).parameters[name].default


FIGURES = [
    ("method.md", f"**Default: cubic spline, dilation {COMMON.dilation:g}**"),
    ("howto/fluids.md", f"`{LIQUID.weight!r}`, {LIQUID.dilation:g} |"),
    ("method.md", f"**Default: CFL {es.Verlet.cfl:g} for Verlet, {es.LaxWendroff.cfl:g} for the others.**"),
    ("method.md", f"|∇v| Δt is at most CFL/{1.0 / flux_kernels.STRAIN:g}"),
    ("method.md", f"**Default: ε = {es.Verlet().dissipation.epsilon:g}, no sensor.**"),
    ("method.md", f"**Default: χ = {word(es.Verlet().tie.stiffness)}**"),
    ("method.md", f"**Default: s = {es.Verlet().tilt.most:g}**"),
    ("method.md", f"**Default: `Balance(sweeps={es.Balance().sweeps}, bound={es.Balance().bound:g})`**"),
    ("method.md", f"`Shifting(rate={es.Shifting().rate:g}, bound={es.Shifting().bound:g})`"),
    ("method.md", f"at most {BOUND} spacing;"),
    ("method.md", f"the threshold is {exposure.EXPOSED:g}"),
    ("performance.md", f"{simulation.STEPS_BETWEEN_LOOKS} of them between two looks of the host"),
    ("performance.md", f"the default below {2 * execution.LEAST_RANGE} particles"),
    ("performance.md", f"the reference moves every {sorting.STEPS_BETWEEN_SORTS} steps"),
    ("performance.md", f"farther than {word(sorting.APART)} spacings from the one before them"),
    ("performance.md", f"sorted when these are more than {word(sorting.MOST_PARTED)}, and twice as many as in order"),
    ("runs.md", f"checkpoints, the last {word(checkpoint.KEPT)} |"),
    ("cases.md", f"nearer than {surface.WELD:.0e} of the size".replace("e-0", "e-")),
    ("cases.md", f"grow to {word(transport.GROWN)} times the largest at the start"),
    ("howto/quasi_static.md", f"settle(beam, {default(es.settle, 'tolerance'):.0e}".replace("e-0", "e-")),
]


@pytest.mark.parametrize(("page", "figure"), FIGURES, ids=[figure[:50] for _, figure in FIGURES])
def test_pages_have_the_figures_of_the_code(page, figure):
    text = re.sub(r"\s+", " ", (DOCS / page).read_text(encoding="utf-8"))
    assert figure in text


def test_figures_that_the_pages_have_once_for_several():
    """CFL of the others; no sensor; sorted when twice as many; defaults that go without a number."""
    assert lax.Lax.cfl == es.LaxWendroff.cfl
    assert es.Verlet().dissipation.sensor is es.LaxWendroff().dissipation.sensor is None
    assert es.Verlet().limiter is es.LaxWendroff().limiter is None
    assert es.CubicSpline() == COMMON.weight and sorting.MUCH_MORE == 2.0
    assert es.Verlet() == COMMON.scheme
    text = inspect.getdoc(time_step.TimeStep)
    assert f"{es.Verlet.cfl:g} for Verlet and {es.LaxWendroff.cfl:g} for the others" in text
    assert f"CFL/{1.0 / flux_kernels.STRAIN:g}" in text
