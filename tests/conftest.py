"""What all tests share: the device that they run on, and settings that every test leaves as they were.

``pytest --device cuda:0`` runs what is not about the CPU itself on a GPU: arrays, kernels and simulations that name no
device are on it.
"""

import pytest
import warp as wp

from warp_eulsph import execution


def pytest_addoption(parser):
    parser.addoption("--device", default="cpu", help="Warp device to test on, e.g. cuda:0; by default cpu")


def pytest_configure(config):
    config.addinivalue_line("markers", "of_the_cpu: about threads, SIMD kernels, memory or processes of the CPU")
    name = config.getoption("--device")
    known = [device.alias for device in wp.get_devices()]
    if name not in known:
        raise pytest.UsageError(f"--device must be one of {', '.join(known)}, got {name!r}")
    wp.set_device(name)


def pytest_collection_modifyitems(config, items):
    if config.getoption("--device") != "cpu":
        skip = pytest.mark.skip(reason="about the CPU; run it without --device")
        for item in items:
            if item.get_closest_marker("of_the_cpu"):
                item.add_marker(skip)


@pytest.fixture(scope="session")
def device(pytestconfig):
    """The device that the tests run on, which is the default device."""
    return wp.get_device(pytestconfig.getoption("--device"))


@pytest.fixture(autouse=True)
def _settings():
    """Threads, SIMD kernels and graphs as they were before."""
    threads, simd, graphs = execution.threads(), execution._simd, execution._graphs
    yield
    execution.set_simd(simd)
    execution.set_graphs(graphs)
    if execution.threads() != threads:
        execution.set_threads(threads)
