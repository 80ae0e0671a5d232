"""The house rules that a program can hold: layers, who imports HDF5, lengths, no print."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import warp_eulsph
from warp_eulsph import structs
from warp_eulsph.fields import GROUPS, clock_structure, neighbour_structure
from warp_eulsph.space import Space

PACKAGE = Path(__file__).parents[1] / "warp_eulsph"
FILES = sorted(PACKAGE.rglob("*.py"))

# Rooms and single files of the package, lowest layer first: a file imports from its own layer or below, never upwards.
LAYERS = [
    {"space", "linalg", "execution", "turns", "atomics", "simd", "order", "checks", "notices", "whole", "options"}
    | {"kernel_cache", "structs"},
    {"fields", "weights", "materials", "boundaries", "reduce", "schedule", "summary"},
    {"operators", "memory", "geometry"},
    {"scheme", "interactions"},
    {"body", "overlap"},
    {"progress", "diagnostics", "sorting", "arguments", "failure", "worst", "building", "settling", "defaults"}
    | {"runs"},
    {"output"},  # below what it records, of which it knows protocols only
    {"simulation", "looks", "transport", "programs"},
    {"validation", "pictures", "bench"},
    {"cases"},
    {"commands", "cli", "__main__"},
]
LAYER = {room: k for k, rooms in enumerate(LAYERS) for room in rooms}
# The front door shows rooms up to the simulation: those above may come in by it.
LAYER |= dict.fromkeys(warp_eulsph.__all__, LAYER["validation"])
MAX_LINES, MAX_KERNEL_LINES = 400, 60
# What the command line prints is its result
FRONT_ENDS = {"cli.py"} | {
    f"bench/{name}.py"
    for name in (
        *("command", "contact_cost", "equal_error", "many_runs", "memory", "mixing", "passes", "release"),
        "snapshot_cost",
    )
}
FRONT_ENDS |= {
    f"validation/{name}.py"
    for name in ("command", "punch_elements", "step_cost", "balance_sweeps", "coarse", "rods", "rod_elements")
}
FRONT_ENDS |= {f"commands/{path.name}" for path in (PACKAGE / "commands").glob("*.py")}


def room(path):
    """First name below the package: ``scheme/flux.py`` is in ``scheme``, ``space.py`` is ``space``."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path):
    """(room imported, line) of the package's own, and (name, line) of other top-level packages."""
    own, foreign = [], []
    package = [PACKAGE.name, *path.relative_to(PACKAGE).parts[:-1]]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name.split(".") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else []
            module = [*base, *(node.module.split(".") if node.module else [])]
            names = [module] if len(module) > 1 or not node.level else [[*module, a.name] for a in node.names]
        else:
            continue
        for parts in names:
            if parts[0] == PACKAGE.name:
                own += [(parts[1], node.lineno)] if len(parts) > 1 else []
            else:
                foreign.append((parts[0], node.lineno))
    return own, foreign


def kernels(path):
    """(name, lines) of every function decorated as a Warp kernel."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef) and "wp.kernel" in decorators(node):
            yield node.name, node.end_lineno - node.lineno + 1


def decorators(node):
    return " ".join(ast.unparse(decorator) for decorator in node.decorator_list)


def test_there_is_something_to_check():
    assert len(FILES) > 30 and sum(len(list(kernels(path))) for path in FILES) > 20
    own = {name for path in FILES for name, _ in imports(path)[0]}
    assert {"space", "fields", "materials", "operators", "scheme"} <= own


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
class TestFile:
    def test_has_a_layer_and_never_imports_upwards(self, path):
        if path == PACKAGE / "__init__.py":
            return  # the front door shows every room
        assert room(path) in LAYER, f"{room(path)} has no layer; give it one in LAYERS"
        own, _ = imports(path)
        upwards = [f"line {line}: {name}" for name, line in own if LAYER[name] > LAYER[room(path)]]
        assert not upwards, upwards

    def test_only_output_imports_h5py(self, path):
        _, foreign = imports(path)
        assert room(path) == "output" or "h5py" not in dict(foreign)

    def test_output_knows_no_class_of_what_it_records(self, path):
        """Its protocols are in ``output/recorded.py``; a circle of imports would be back, lazily or not."""
        own, _ = imports(path)
        text = ast.unparse(ast.parse(path.read_text(encoding="utf-8")))
        assert room(path) != "output" or not [name for name, _ in own if name in ("simulation", "transport", "looks")]
        assert room(path) != "output" or not re.search(r"isinstance\(\w+, (Simulation|Transport)", text)

    def test_launches_by_the_launcher(self, path):
        """Which splits every kernel over particles over threads; what it launches in one piece is of one thread."""
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Attribute) and path != PACKAGE / "execution.py":
                assert ast.unparse(node) not in ("wp.launch", "wp.launch_tiled", "warp.launch"), f"line {node.lineno}"
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "once":
                assert ast.unparse(node.args[1]) == "1", f"line {node.lineno}: a kernel of several threads in one piece"

    def test_kernels_are_made_where_messages_about_them_are_summed_up(self, path):
        """In functions ``make_…``: by these names ``notices`` knows the package's kernels."""
        tree = ast.parse(path.read_text(encoding="utf-8"))
        makers = [node for node in tree.body if isinstance(node, ast.FunctionDef) and "make_" in node.name]
        made = {id(node) for maker in makers for node in ast.walk(maker)}
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and "wp.kernel" in decorators(node):
                assert id(node) in made, node.name

    def test_kernels_can_be_split(self, path):
        """A kernel of several threads begins at ``first`` and sums nothing into what another thread writes to."""
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.FunctionDef) or "wp.kernel" not in decorators(node):
                continue
            text = ast.unparse(node)
            assert not re.search(r"wp\.atomic_\w+", text), f"{node.name}: Warp's atomics are for one thread on the CPU"
            if "wp.tid()" in text:
                assert node.args.args[0].arg == "first" and text.count("first + wp.tid()") == 1, node.name

    def test_is_short(self, path):
        assert len(path.read_text(encoding="utf-8").splitlines()) <= MAX_LINES
        long = [(name, lines) for name, lines in kernels(path) if lines > MAX_KERNEL_LINES]
        assert not long, f"kernels of at most {MAX_KERNEL_LINES} lines, got {long}"

    def test_logs_instead_of_printing(self, path):
        if path.relative_to(PACKAGE).as_posix() in FRONT_ENDS or room(path) == "commands":
            return
        tree = ast.parse(path.read_text(encoding="utf-8"))
        prints = [node.lineno for node in ast.walk(tree) if isinstance(node, ast.Name) and node.id == "print"]
        assert not prints, f"print in lines {prints}; use logging"

    def test_leaves_nothing_for_later(self, path):
        text = path.read_text(encoding="utf-8")
        assert not [word for word in ("TO" + "DO", "FIX" + "ME", "X" * 3) if word in text]


def test_tests_and_examples_are_short():
    files = [path for folder in ("tests", "examples") for path in (PACKAGE.parent / folder).rglob("*.py")]
    long = [path.name for path in files if len(path.read_text(encoding="utf-8").splitlines()) > MAX_LINES]
    assert len(files) > 90 and not long


HEAVY = ("h5py", "matplotlib", "vtkmodules", "pyvista", "meshio", "PIL", "pydantic", "xarray", "pandas")


@pytest.mark.parametrize(
    "code",
    [
        "import warp_eulsph",
        "import warp_eulsph.geometry, warp_eulsph.pictures",
        "from warp_eulsph.cli import main\ntry: main(['plot', '--help'])\nexcept SystemExit: pass",
    ],
)
def test_start_does_not_load_hdf5_pictures_or_meshes(code):
    code = f"import sys\n{code}\nprint([m for m in {HEAVY} if m in sys.modules])"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert shown.strip().splitlines()[-1] == "[]"


def test_cases_run_without_any_extra(tmp_path):
    """As after a plain ``pip install warp_eulsph``: what pictures, meshes and data sets need is not there."""
    extras = ("matplotlib", "PIL", "pyvista", "vtkmodules", "meshio", "trimesh", "manifold3d", "xarray", "pandas")
    extras += ("scipy", "imageio_ffmpeg")
    code = (
        f"import sys\nfor name in {extras}: sys.modules[name] = None\n"
        "from warp_eulsph.cli import main\n"
        "assert main(['run', 'example:cosine_profile', '-o', 'a']) == 0\n"
        "assert main(['run', 'example:punch', '-s', 'parameters.n=6', '-s', 'until=1e-3', '-o', 'b']) == 0\n"
        "assert main(['info', 'b']) == main(['check', 'b']) == main(['export', 'b', 'b.csv']) == 0\n"
        "assert main(['plot', 'b']) == 2\n"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert "pictures need matplotlib: pip install 'warp_eulsph[viz]'" in ran.stderr


PROTOCOLS = [value for value in vars(structs).values() if getattr(value, "__module__", "") == structs.__name__]


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_protocols_have_the_arrays_of_their_struct(protocol):
    """What host code is checked by is what kernels get."""
    space = Space(2)
    made = {"NeighbourRows": neighbour_structure, "ClockArrays": clock_structure}
    tables = {"ParticleArrays": "Particles", "StateArrays": "State", "ReferenceArrays": "Reference"}
    tables |= {"FluxArrays": "Flux", "ForceArrays": "Forces"}
    if protocol.__name__ in made:
        names = list(made[protocol.__name__](space).vars)
    else:
        names = list(GROUPS[tables[protocol.__name__]])
    assert list(protocol.__annotations__) == names
