"""A damaged file in Warp's cache of compiled kernels costs a compilation, not the run."""

import subprocess
import sys

import pytest
import warp as wp

from warp_eulsph import kernel_cache
from warp_eulsph.operators.correction import make_correct
from warp_eulsph.operators.gradient import make_gradient
from warp_eulsph.space import Space

PROGRAM = """
import logging, sys
import warp as wp
wp.config.kernel_cache_dir = sys.argv[1]
logging.basicConfig(level=logging.WARNING, format="%(message)s")
import warp_eulsph as es
from warp_eulsph.geometry import box
x, volume = box((0.0,), (1.0,), 0.25)
simulation = es.Simulation(es.Body(x=x, volume=volume, velocity=x, material=es.Bar(density=1e3, young=1e7)))
simulation.step(2)
print("energy", simulation.energy()["total"].hex())
"""

SPACE = Space(3, wp.float64)


def run(cache):
    ran = subprocess.run([sys.executable, "-c", PROGRAM, str(cache)], capture_output=True, text=True)
    return ran.returncode, [line for line in ran.stdout.splitlines() if line.startswith("energy")], ran.stderr


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    folder = tmp_path_factory.mktemp("kernels")
    code, energy, _ = run(folder)
    assert code == 0 and energy
    return folder, energy


# How much is left of a file of a length; a flipped bit in the machine code itself is not seen.
DAMAGES = (lambda length: length // 2, lambda length: 0, lambda length: 100, lambda length: length - 10)


@pytest.mark.of_the_cpu
@pytest.mark.parametrize("kernel", [make_gradient(SPACE, 3, simd=True), make_correct(SPACE)], ids=lambda k: k.key)
def test_templates_instantiated_with_the_header_change_no_byte(tmp_path, kernel):
    before, given, codes = dict(kernel.module.options), wp.config.cpu_compiler_flags, []
    try:
        for name, flags in (("plain", given), ("once", f"{given} {kernel_cache.ONCE}")):
            wp.set_module_options({"cpu_compiler_flags": flags}, kernel.module)
            wp.compile_aot_module(kernel.module, "cpu", module_dir=tmp_path / name, strip_hash=True)
            (code,) = (tmp_path / name).glob("*.o")
            codes.append(code.read_bytes())
    finally:
        wp.set_module_options(before, kernel.module)
    assert len(codes[0]) > 1000 and codes[0] == codes[1]


def test_flags_that_a_user_gave_are_kept(monkeypatch):
    class Module:
        name, options = "make_forces__locals__forces", {"cpu_compiler_flags": None}

    monkeypatch.setattr(wp, "set_module_options", lambda options, module: setattr(module, "options", options))
    for given, found in (("-O1", "-O1"), ("", ""), (None, kernel_cache.WARPS_FLAGS)):
        monkeypatch.setattr(wp.config, "cpu_compiler_flags", given)
        module = Module()
        kernel_cache._instantiate_once(module)
        assert module.options == {"cpu_compiler_flags": f"{found} {kernel_cache.ONCE}"}
        monkeypatch.setattr(wp.config, "cpu_compiler_flags", "-O3")
        kernel_cache._instantiate_once(module)  # what a module was first loaded with stays
        assert module.options == {"cpu_compiler_flags": f"{found} {kernel_cache.ONCE}"}


def test_what_is_damaged_is_built_anew(cache):
    """All damages of both kinds of files at once, each in a module of its own, for a start of Python takes its time."""
    folder, energy = cache
    codes, metas = (sorted(folder.rglob(f"wp__make_*{suffix}")) for suffix in (".o", ".meta"))
    damaged = [*codes[::5][: len(DAMAGES)], *metas[2::5][: len(DAMAGES)]]
    before = {path: path.read_bytes() for path in damaged}
    for path, left in zip(damaged, 2 * DAMAGES, strict=True):
        path.write_bytes(path.read_bytes()[: min(left(path.stat().st_size), path.stat().st_size - 10)])
    folders = {path.parent for path in damaged}
    assert len(folders) == len(damaged)
    others = {path: path.stat().st_mtime_ns for path in folder.rglob("*.o") if path.parent not in folders}
    code, found, said = run(folder)
    assert code == 0 and found == energy, said
    assert said.count("cannot be loaded") == said.count("building it anew") == len(damaged)
    assert all(len(path.read_bytes()) == len(content) for path, content in before.items())
    assert others == {path: path.stat().st_mtime_ns for path in others}  # nobody else's file was touched
    assert "cannot be loaded" not in run(folder)[2]


def test_what_cannot_be_removed_is_one_clear_error(monkeypatch, tmp_path):
    path = tmp_path / "wp__make_adopt.o"
    path.mkdir()  # which unlink refuses
    with pytest.raises(OSError, match=r"the compiled kernel .* cannot be removed .*WARP_CACHE_PATH=FOLDER"):
        kernel_cache._remove([path])


def test_other_programs_modules_are_left_alone(monkeypatch, tmp_path):
    class Theirs:
        name, options = "simulation", {"cpu_compiler_flags": None}

    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    assert kernel_cache._compiled(Theirs(), None) == []
    calls = []

    def load(module, device, block_dim=None):
        calls.append(module)
        raise RuntimeError("as it was")

    with pytest.raises(RuntimeError, match="as it was"):
        kernel_cache._rebuilding(load)(Theirs(), "cpu")
    assert len(calls) == 1 and Theirs.options == {"cpu_compiler_flags": None}
