"""Attacks on what must be neither silent nor lost: ``python tests/attacks.py --seed 0 --count 900``.

Each attack is drawn at random from its class by a seed, which is printed where it goes wrong, to run it again. It ends
as *held*, the right value came out, or *refused*, an error that says what is wrong. Anything else is a fault:
*silent*, a wrong value that nobody was told; *lost*, data that were whole before; *traceback*, an error that nobody
meant. A table says how many of each there were; exit status 1 where there was a fault.
"""

import argparse
import collections
import contextlib
import io
import logging
import os
import random
import shutil
import signal
import sys
import tempfile
import threading
import time
import traceback
from pathlib import Path

import numpy as np
from bodies import RUBBER
from kept_runs import plate
from test_damage import CASE, commands, files, mutated
from test_meshes import angle_profile, brick, write
from test_resume import bits

import warp_eulsph as es
from warp_eulsph import execution
from warp_eulsph.cli import main as command_line
from warp_eulsph.geometry import Relaxation, Repair, box, mesh
from warp_eulsph.output import ChangedCaseError, Recording, record
from warp_eulsph.output.checkpoint import take
from warp_eulsph.schedule import AnyOf, AtTimes, EverySteps, EveryTime
from warp_eulsph.whole import BrokenError

HELD, REFUSED = "held", "refused"
FAULTS = ("silent", "lost", "traceback")


class SilentError(AssertionError):
    """A wrong value, and nobody was told."""


class LostError(AssertionError):
    """What was whole is gone."""


def right(condition, what):
    """SilentError unless it holds."""
    if not condition:
        raise SilentError(what)


# exceptions and interrupts in steps


class OddError(Exception):
    """What a user's function raises."""


def exception_in_a_step(rng, folder):
    """Any exception at any launch of a kernel: refused until restored, then the same bits."""
    simulation, whole = plate(), plate()
    for each in (simulation, whole):
        each.by_graphs = False
        each.step(2)
    start = take(simulation, {}, {})
    kind = rng.choice([OddError, KeyboardInterrupt, MemoryError, RuntimeError, SystemExit])
    left, launch = [rng.randrange(120)], execution.Launcher.__call__

    def failing(self, *arguments, **options):
        left[0] -= 1
        if left[0] == 0:
            raise kind("attack")
        return launch(self, *arguments, **options)

    execution.Launcher.__call__ = failing
    try:
        simulation.step(4)
    except kind:
        for again in (simulation.step, lambda: simulation.run(until=1.0), lambda: take(simulation, {}, {})):
            try:
                again()
                raise SilentError(f"went on after {kind.__name__} at launch {left}")
            except BrokenError:
                pass
        execution.Launcher.__call__ = launch
        simulation.restore(start.arrays, start.counters)
        simulation.step(4)
    finally:
        execution.Launcher.__call__ = launch
    whole.step(4)
    right(bits(simulation) == bits(whole), f"{kind.__name__} changed bits")
    return HELD


def interrupt(rng, folder):
    """Ctrl-C at any moment waits for the end of the step."""
    simulation, whole = plate(), plate()
    simulation.by_graphs = whole.by_graphs = rng.random() < 0.5
    simulation.step(3), whole.step(3)
    begin = time.perf_counter()
    whole.step(20)
    timer = threading.Timer(rng.random() * (time.perf_counter() - begin), os.kill, (os.getpid(), signal.SIGINT))
    with contextlib.suppress(KeyboardInterrupt):
        timer.start()
        simulation.step(20)
        timer.join()
        time.sleep(0.005)
    timer.join()
    simulation.step(23 - simulation.steps)
    right(bits(simulation) == bits(whole), "an interrupt changed bits")
    return HELD


# regions and values


X = plate().X
FACE = np.flatnonzero(X[:, 0] == X[:, 0].max()).tolist()


def values(rng, folder):
    """Regions and rows of values in any order and shape: rows go where they say, or are refused."""
    condition = rng.choice(["Velocity", "BodyForce", "Traction", "Pressure", "function"])
    among = FACE if condition in ("Traction", "Pressure") else range(len(X))
    numbers = rng.sample(list(among), rng.randint(3, 6))
    k = len(numbers)
    shape = rng.choice([(k, 2), (k, 2), (k, 2), (k,), (k, 1), (1, 2), (2,), (), (2, k), (k, 2, 1), (k - 1, 2)])
    given = np.asarray(np.random.default_rng(rng.randrange(10**6)).normal(size=shape))
    kind = rng.choice(["array", "array", "list", "float32", "masked", "complex", "Fortran", "strided"])
    shown = {
        "array": lambda: given,
        "list": lambda: given.tolist(),
        "float32": lambda: given.astype(np.float32),
        "masked": lambda: np.ma.array(given, mask=given > 0),
        "complex": lambda: given + 1j,
        "Fortran": lambda: np.asfortranarray(given) if given.ndim else given,
        "strided": lambda: np.repeat(given, 2, axis=0)[::2] if given.ndim else given,
    }[kind]
    exact = given.astype(np.float32).astype(float) if kind == "float32" else given
    columns = 1 if condition == "Pressure" else 2

    def stepped(numbers, values):
        made = {
            "Velocity": lambda: es.Velocity(region=numbers, value=values),
            "BodyForce": lambda: es.BodyForce(values, region=numbers),
            "function": lambda: es.BodyForce(lambda x, t: values, region=numbers),
            "Traction": lambda: es.Traction(values, normal=(1.0, 0.0), region=numbers),
            "Pressure": lambda: es.Pressure(values, region=numbers),
        }[condition]()
        simulation = es.Simulation(plate().bodies[0], boundaries=[made], reference=es.Never())
        simulation.step(2)
        return simulation

    allowed = {(), (columns,), (k, columns)} | ({(k,)} if columns == 1 else set())
    meant = given.shape in allowed and kind not in ("masked", "complex")
    try:
        simulation = stepped(numbers, shown())
    except ValueError as error:
        right("must" in str(error), f"unclear: {error}")
        right(not meant, f"{condition} refused {given.shape} {kind}: {error}")
        return REFUSED
    right(meant, f"{condition} took {given.shape} {kind}")
    rows = np.broadcast_to(exact[:, None] if columns == 1 and exact.shape == (k,) else exact, (k, columns))
    order = np.argsort(numbers)
    other = stepped(np.array(numbers)[order], np.ascontiguousarray(rows[order]))
    right(np.array_equal(simulation.v, other.v), f"{condition}: order counts")
    if condition == "Velocity":
        right(np.array_equal(simulation.v[numbers], rows), "rows went elsewhere")
    return HELD


# run folders


def run_folder(rng, folder):
    """A recorded run damaged in JSON, HDF5 and names: every command says so, and what is whole is kept."""
    original = folder / "original"
    if not original.exists():
        (folder / "plate.toml").write_text(CASE)
        right(command_line(["run", str(folder / "plate.toml"), "-o", str(original)]) == 0, "the case does not run")
    whole = {path.read_bytes() for path in files(original) if path.suffix in (".vtkhdf", ".h5")}
    derived = {path.read_bytes() for path in original.glob("run.vtkhdf")}  # made anew at will
    directory = shutil.copytree(original, folder / "mutated")
    try:
        done = mutated(directory, rng.randrange(10**9))
        kept = {path.read_bytes() for path in files(directory)} & whole
        for arguments, status in commands(directory, folder):
            if status not in (0, 2, 3):
                raise RuntimeError(f"{done}: {arguments[0]} ended with {status}")
        left = {path.read_bytes() for path in files(directory)}
        if (kept - left) - derived:
            raise LostError(done)
    finally:
        shutil.rmtree(directory)
    return HELD


# loads changed before a resume


class Pusher:
    """A load with a state, whose method is given."""

    def __init__(self, strength):
        self.strength = strength

    def push(self, x, t):
        return self.strength + 0.0 * x


def load_of(kind, strength):
    """A function of place and time that depends on ``strength`` in some way."""

    def plain(x, t):
        return strength + 0.0 * x

    def nested(x, t):
        def inner():
            return plain(x, t)

        return inner()

    def keyword(x, t, *, strength=strength):
        return strength + 0.0 * x

    table = {"strength": [strength]}
    return {
        "closure": plain,
        "enclosed twice": nested,
        "default": lambda x, t, s=strength: s + 0.0 * x,
        "keyword default": keyword,
        "bound method": Pusher(strength).push,
        "array": (lambda rows: lambda x, t: rows + 0.0 * x)(np.array([strength, 0.0])),
        "table": lambda x, t: table["strength"][0] + 0.0 * x,
        "object": (lambda pusher: lambda x, t: pusher.push(x, t))(Pusher(strength)),
        "list of functions": (lambda some: lambda x, t: some[0](x, t))([plain]),
        "constant": np.array([strength, 0.0]),
    }[kind]


LOADS = (
    *("closure", "enclosed twice", "default", "keyword default", "bound method", "array", "table", "object"),
    *("list of functions", "constant"),
)


def changed_load(rng, folder):
    """A load that is another than that of the checkpoint is seen; the same one is not refused."""
    kind, strength = rng.choice(LOADS), rng.choice([1e3, -2.5, 1e6])
    same = rng.random() < 0.3
    later = strength if same else strength * (1.0 + rng.choice([1e-15, 1e-3, 1.0]) * rng.choice([1, -1]))
    same = later == strength

    def build(of):
        body = plate().bodies[0]
        return es.Simulation(body, boundaries=[es.BodyForce(load_of(kind, of))], reference=es.Never())

    directory = folder / "load"
    try:
        record(build(strength), directory, 1e-4, Recording())
        try:
            record(build(later), directory, 2e-4, Recording(), resume=True)
        except ChangedCaseError:
            right(not same, f"{kind}: the same load is refused")
            return REFUSED
        right(same, f"{kind}: {strength} became {later} unseen")
        return HELD
    finally:
        shutil.rmtree(directory, ignore_errors=True)


# meshes


MESH_CHANGES = (
    "split",
    "shuffle",
    "turn",
    "twice",
    "jitter",
    "rotate",
    "unused",
    "flip",
    "delete",
    "double",
    "collapse",
)


def changed_mesh(rng, points, triangles):
    """The surface written otherwise, or spoilt; and whether it is the same body still."""
    random_numbers = np.random.default_rng(rng.randrange(10**9))
    same, done = True, rng.choices(MESH_CHANGES, k=rng.randint(1, 4))
    for change in done:
        if change == "split":
            points, triangles = points[triangles].reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)
        elif change == "shuffle":
            order = random_numbers.permutation(len(points))
            points, triangles = points[order], np.argsort(order)[triangles][random_numbers.permutation(len(triangles))]
        elif change == "turn":
            triangles = triangles[:, ::-1]
        elif change == "twice":
            triangles = np.concatenate([triangles, triangles[random_numbers.integers(0, len(triangles), 3)]])
        elif change == "rotate":
            triangles = np.array([np.roll(corners, random_numbers.integers(3)) for corners in triangles])
        elif change == "unused":
            points = np.concatenate([points, 100.0 + random_numbers.random((5, 3))])
        elif change == "jitter":
            size = np.ptp(points[np.unique(triangles)], axis=0).max()
            points = points + 2e-8 * size * random_numbers.uniform(-1, 1, points.shape)
        elif change == "double":  # the whole surface written once more
            points, triangles = np.tile(points, (2, 1)), np.concatenate([triangles, triangles + len(points)])
        elif change == "flat":  # a facet without an area
            triangles = np.concatenate([triangles, triangles[:1, [0, 1, 1]]])
        elif change == "flip":
            one = random_numbers.integers(len(triangles))
            triangles, same = triangles.copy(), False
            triangles[one] = triangles[one, ::-1]
        else:
            triangles, same = np.delete(triangles, random_numbers.integers(len(triangles)), axis=0), False
    return points, triangles, same, done


def mesh_file(rng, folder):
    """Bricks and a profile, merged, duplicated, split, flipped: the volume of cells counted one by one, or refused."""
    scale, lattice = rng.choice([1.0, 1e-3, 1e3]), 8
    kind = rng.choice(["brick", "profile", "two", "two", "hollow"])
    cells = (np.stack(np.meshgrid(*[np.arange(2 * lattice) + 0.5] * 3, indexing="ij"), axis=-1) / lattice).reshape(
        -1, 3
    )

    def within(low, high):
        return ((cells > low) & (cells < high)).all(axis=1)

    if kind == "profile":
        points, triangles = angle_profile()
        inside = within(0.0, 1.0) & ~((cells[:, 0] > 0.5) & (cells[:, 1] > 0.5))
    elif kind == "hollow":
        pieces = [brick((0.0,) * 3, (1.0,) * 3), brick((0.25,) * 3, (0.75,) * 3)]
        points = np.concatenate([piece[0] for piece in pieces])
        triangles = np.concatenate([pieces[0][1], pieces[1][1][:, ::-1] + 8])
        inside = within(0.0, 1.0) & ~within(0.25, 0.75)
    else:
        places = [(np.zeros(3), np.ones(3))]
        if kind == "two":
            low = np.array([rng.randrange(0, lattice + 1) for _ in range(3)]) / lattice
            places.append((low, low + np.array([rng.randint(2, lattice) for _ in range(3)]) / lattice))
        pieces = [brick(*place) for place in places]
        points = np.concatenate([piece[0] for piece in pieces])
        triangles = np.concatenate([piece[1] + 8 * k for k, piece in enumerate(pieces)])
        inside = np.any([within(*place) for place in places], axis=0)
    points, triangles, same, done = changed_mesh(rng, scale * points, triangles)
    path = write(folder / "attack.vtk", points, triangles)
    repair = Repair(close=rng.random() < 0.4, turn=rng.random() < 0.4)
    volume = inside.sum() * (scale / lattice) ** 3
    try:
        x, volumes = mesh(path, scale / lattice, repair=repair)
    except ValueError as error:
        right("repair=" in str(error) or "mesh tool" in str(error), f"no way out: {error}")
        if kind not in ("two",):
            right(not same, f"{kind}, {done}: refused: {error}")
        return REFUSED
    # A deleted facet that was closed again is the same body where its rim is flat, and all rims of one facet are
    off = abs(volumes.sum() / volume - 1.0)
    right(off < 1e-5 or (not same and repair.close), f"{kind}, {done}, {repair}: {volumes.sum()} for {volume}")
    right(len(x) == inside.sum() or not same, f"{kind}, {done}: {len(x)} particles for {inside.sum()}")
    return HELD


# wrong types


def wrong_type(rng, folder):
    """Something of a wrong kind in any option: an error of the package that says what it must be."""
    x, volume = box((0.0, 0.0), (1.0, 1.0), 0.25)
    body = {"x": x, "volume": volume, "material": RUBBER}
    number = rng.choice(["1", None, [1.0], {}, object(), b"1", 1j, es.Fixed, np.ones(3), float("nan"), True])
    not_option = rng.choice(["Always", 3, es.Never, [], {"kind": "Never"}, object(), 1.5, True])
    simulation = es.Simulation(es.Body(**body))
    makes = {
        "young": lambda: es.NeoHookean(density=1.0, young=number, poisson=0.3),
        "density": lambda: es.LinearElastic(density=number, young=1.0, poisson=0.3),
        "volume": lambda: es.Body(**{**body, "volume": number if number is not True else "1"}),
        "spacing": lambda: es.Body(**body, spacing=number if number is not None else "1"),
        "velocity": lambda: es.Body(**body, velocity=number if number is not None else "1"),
        "x": lambda: es.Body(**{**body, "x": number}),
        "material": lambda: es.Body(**{**body, "material": not_option}),
        "name": lambda: es.Body(**body, name=rng.choice([3, None, b"a", ""])),
        "reference": lambda: es.Simulation(es.Body(**body), reference=not_option),
        "arrangement": lambda: es.Simulation(es.Body(**body), arrangement=not_option),
        "scheme": lambda: es.Simulation(es.Body(**body), scheme=not_option),
        "weight": lambda: es.Simulation(es.Body(**body), weight=not_option),
        "time_step": lambda: es.Simulation(es.Body(**body), time_step=not_option),
        "dissipation": lambda: es.Verlet(dissipation=not_option),
        "correction": lambda: es.LaxWendroff(correction=not_option),
        "limiter": lambda: es.Verlet(limiter=not_option),
        "tie": lambda: es.Verlet(tie=not_option),
        "smoothing": lambda: es.LaxWendroff(smoothing=not_option),
        "dilation": lambda: es.Simulation(es.Body(**body), dilation=number),
        "periodic": lambda: es.Simulation(es.Body(**body), periodic=number if number is not None else "1"),
        "dtype": lambda: es.Simulation(es.Body(**body), dtype=not_option),
        "boundaries": lambda: es.Simulation(es.Body(**body), boundaries=not_option if not_option != [] else 3),
        "cfl": lambda: es.TimeStep(cfl=number if number is not None else "1"),
        "growth": lambda: es.TimeStep(growth=number),
        "until": lambda: simulation.run(until=number),
        "every": lambda: simulation.run(until=1e-6, every=number if number is not None else "1"),
        "count": lambda: simulation.step(rng.choice([1.5, "1", None, -1, [], True])),
        "steps": lambda: es.Every(rng.choice([1.5, "1", None, 0, [], True])),
        "ratio": lambda: es.WhenDistorted(number),
        "EveryTime": lambda: EveryTime(number),
        "EverySteps": lambda: EverySteps(rng.choice([1.5, "1", None, 0, [], True])),
        "AtTimes": lambda: AtTimes(rng.choice(["12", 0.1, [None], [1j], [[1.0]], [2.0, 1.0]])),
        "AnyOf": lambda: AnyOf(rng.choice([3, "a", [3], [es.Never()]])),
        "fields": lambda: Recording(fields=rng.choice(["velocity", ["speed"], 3, [3]])),
        "probes": lambda: Recording(probes=rng.choice([3, "a", [3]])),
        "snapshots": lambda: Recording(snapshots=not_option),
        "checkpoint": lambda: Recording(checkpoint=number),
        "sweeps": lambda: Relaxation(sweeps=rng.choice([1.5, "1", None, 0, [], True])),
        "region": lambda: es.Simulation(es.Body(**body), boundaries=[es.Fixed(rng.choice([3, "a", [0.5], lambda: 3]))]),
        "axes": lambda: es.Simulation(es.Body(**body), boundaries=[es.Fixed(axes=rng.choice([1, "x", [3], [0.5]]))]),
        "value": lambda: es.Simulation(es.Body(**body), boundaries=[es.Velocity(value=number)]),
        "keyword": lambda: rng.choice([es.Verlet, es.TimeStep, es.Fixed, es.Balance, es.Upwind])(flavour=3),
        "box": lambda: box((0.0, 0.0), (1.0, 1.0), number),
        "output": lambda: simulation.run(until=1e-9, output=rng.choice([3, 1.5, [], {}])),
    }
    name = rng.choice(list(makes))
    try:
        makes[name]()
    except (ValueError, TypeError) as error:
        frames = traceback.extract_tb(error.__traceback__)
        package = str(Path(es.__file__).parent)
        if not frames[-1].filename.startswith(package):
            raise
        right(len(str(error)) > 20, f"{name}: unclear: {error}")
        return REFUSED
    raise SilentError(f"{name} took {number!r} or {not_option!r}")


ATTACKS = {
    "exceptions at any launch of a step": (exception_in_a_step, 2),
    "Ctrl-C at any moment": (interrupt, 1),
    "regions and values, orders, shapes": (values, 2),
    "run folders damaged": (run_folder, 1),
    "loads changed before a resume": (changed_load, 1),
    "meshes written otherwise or spoilt": (mesh_file, 2),
    "wrong types": (wrong_type, 2),
}


def attacked(name, seed, folder):
    """One attack of a class: how it ended, and what is to be said where it is a fault."""
    attack, rng = ATTACKS[name][0], random.Random(f"{name} {seed}")
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            outcome = attack(rng, folder)
        if "Traceback" in said.getvalue():
            return "traceback", said.getvalue()
        return outcome, ""
    except SilentError as error:
        return "silent", str(error)
    except LostError as error:
        return "lost", str(error)
    except Exception:
        return "traceback", traceback.format_exc()


def campaign(seed, count, only=None):
    """Outcomes by class of attack, ``count`` attacks in all."""
    names = [name for name in ATTACKS if only is None or only in name]
    share = sum(ATTACKS[name][1] for name in names)
    outcomes = {name: collections.Counter() for name in names}
    logging.disable(logging.WARNING)
    try:
        for name in names:
            with tempfile.TemporaryDirectory() as folder:
                for k in range(-(-count * ATTACKS[name][1] // share)):
                    outcome, said = attacked(name, seed + k, Path(folder))
                    outcomes[name][outcome] += 1
                    if outcome in FAULTS:
                        print(f"{outcome}: {name}, seed {seed + k}: {said}", flush=True)
    finally:
        logging.disable(logging.NOTSET)
    return outcomes


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0, help="of the first attack of each class")
    parser.add_argument("--count", type=int, default=900, help="attacks in all")
    parser.add_argument("--only", help="part of the name of a class")
    arguments = parser.parse_args()
    outcomes = campaign(arguments.seed, arguments.count, arguments.only)
    columns = (HELD, REFUSED, *FAULTS)
    print(f"{'attacks':38} {'count':>6} " + " ".join(f"{column:>10}" for column in columns))
    for name, counts in [*outcomes.items(), ("all", sum(outcomes.values(), collections.Counter()))]:
        print(f"{name:38} {counts.total():6} " + " ".join(f"{counts[column]:10}" for column in columns))
    return int(any(counts[fault] for counts in outcomes.values() for fault in FAULTS))


if __name__ == "__main__":
    sys.exit(main())
