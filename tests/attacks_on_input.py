"""Attacks on what users give: regions and values, meshes, options of wrong types."""

import traceback
from pathlib import Path

import numpy as np
from bodies import RUBBER
from faults import HELD, REFUSED, SilentError, right
from kept_runs import plate
from surfaces import angle_profile, brick, write

import warp_eulsph as es
from warp_eulsph.geometry import Relaxation, Repair, box, mesh
from warp_eulsph.output import Recording
from warp_eulsph.schedule import AnyOf, AtTimes, EverySteps, EveryTime

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
