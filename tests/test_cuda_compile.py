"""Every kernel that a step launches compiles for CUDA, without a GPU: Warp's ahead-of-time compiler needs no driver."""

import numpy as np
import pytest
import warp as wp

import warp_eulsph as es
from warp_eulsph import execution

CASES = [
    pytest.param(3, wp.float32, 90),
    pytest.param(1, wp.float32, 80, marks=pytest.mark.slow),
    pytest.param(2, wp.float64, 80, marks=pytest.mark.slow),
    pytest.param(3, wp.float64, 90, marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("dim", "dtype", "arch"), CASES)
def test_kernels_of_an_eulerian_step_compile(dim, dtype, arch, monkeypatch, tmp_path):
    launched = {}
    launch = wp.launch

    def recording_launch(kernel, *args, **kwargs):
        launched[kernel.module.name] = kernel.module
        return launch(kernel, *args, **kwargs)

    monkeypatch.setattr(wp, "launch", recording_launch)
    monkeypatch.setattr(execution, "_simd", False)  # the portable kernels, which GPUs run
    s = (np.arange(5) + 0.5) / 5
    x = np.stack(np.meshgrid(*[s] * dim, indexing="ij"), -1).reshape(-1, dim)
    material = es.NeoHookean(density=1100.0, young=17e6, poisson=0.45)
    simulation = es.Simulation(
        es.Body(x=x, volume=5.0**-dim, material=material),
        boundaries=[es.Fixed(lambda X: X[:, 0] < 0.2)],
        scheme=es.LaxWendroff(smoothing=es.LinearExact()),
        dtype=dtype,
    )
    simulation.step(2)
    simulation.energy()
    simulation.momentum()
    assert len(launched) > 20
    for module in launched.values():
        wp.compile_aot_module(module, arch=arch, module_dir=tmp_path)
    assert len(list(tmp_path.glob("*.ptx")) + list(tmp_path.glob("*.cubin"))) == len(launched)
