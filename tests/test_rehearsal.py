"""Kernels compiled ahead: a rehearsal finds those that steps launch, and leaves nothing else behind."""

import pytest
import warp as wp
from clouds import cloud

import warp_eulsph as es
from warp_eulsph import execution, rehearsal

SCHEMES = {"Verlet": es.Verlet(), "Lax-Wendroff": es.LaxWendroff(), "Lax": es.Lax()}


@pytest.fixture
def seen(monkeypatch):
    """Modules that were compiled ahead, and those launched afterwards."""
    ahead, launched = {}, {}
    commands = execution.Launcher._commands

    def force_load(device, modules, max_workers=None):
        ahead.update({module.name: module for module in modules})

    def noted(launcher, kernel, *arguments):
        launched[kernel.module.name] = kernel.module
        return commands(launcher, kernel, *arguments)

    monkeypatch.setattr(rehearsal, "_rehearsed", set())
    monkeypatch.setattr(wp, "force_load", force_load)
    monkeypatch.setattr(execution.Launcher, "_commands", noted)
    yield ahead, launched
    execution.set_simd(True)
    execution.set_graphs(None)


def block(**options):
    x, volume = cloud(2, 6)
    material = es.NeoHookean(density=1100.0, young=17e6, poisson=0.3)
    return es.Simulation(es.Body(x=x, volume=volume, material=material, velocity=x - 0.5), **options)


@pytest.mark.parametrize("graphs", [True, False])
@pytest.mark.parametrize("simd", [True, False])
@pytest.mark.parametrize("reference", [es.Never(), es.Always()], ids=repr)
@pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
def test_what_steps_launch_was_compiled_ahead(scheme, reference, simd, graphs, seen):
    execution.set_simd(simd)
    execution.set_graphs(graphs)
    ahead, launched = seen
    block(scheme=scheme, reference=reference).step(4)
    assert len(launched) > 15
    assert launched.keys() <= ahead.keys()


def test_the_same_options_are_rehearsed_once(seen):
    ahead, _ = seen
    block()
    ahead.clear()
    block()
    assert not ahead
    block(dtype=wp.float32)
    assert ahead


def test_a_rehearsal_ends_where_it_fails(seen):
    """Launches are done again afterwards."""
    with pytest.raises(RuntimeError, match="stop"), execution.rehearsal("cpu"):
        raise RuntimeError("stop")
    block().step(2)
    assert seen[1]
