"""Pictures, films and exports of a run: the files say what the snapshots hold."""

import itertools
import sys
from typing import ClassVar

import numpy as np
import pytest
from bodies import lattice
from kept_runs import plate, short_run

from warp_eulsph.cli import main
from warp_eulsph.commands.frames import chosen
from warp_eulsph.output import Run
from warp_eulsph.pictures import Picture, draw_frame, film, fitted, picture, quantity
from warp_eulsph.pictures.cells import corners, rim, sheet, spacing
from warp_eulsph.pictures.draw import suited


@pytest.fixture(scope="module", params=[1, 2, 3], ids=["1d", "2d", "3d"])
def run(request, tmp_path_factory):
    """A short run of four frames in 1-D, 2-D or 3-D."""
    return short_run(request.param, tmp_path_factory.mktemp(f"run{request.param}"))


def image(path):
    from PIL import Image

    return np.asarray(Image.open(path).convert("RGB"))


# what is drawn


@pytest.mark.parametrize(
    ("text", "expected"),
    [("-1", [3]), ("0,2", [0, 2]), ("::2", [0, 2]), (":", [0, 1, 2, 3]), ("-2:", [2, 3]), ("3,:2", [3, 0, 1])],
)
def test_frames_are_chosen_as_in_python(text, expected):
    assert chosen(4, text) == expected


@pytest.mark.parametrize("text", ["9", "x", "", "1:2:3:4", "5:", "::0"])
def test_frames_that_are_not_there_are_named(text):
    with pytest.raises(ValueError, match=r"frames .*4"):
        chosen(4, text)


def test_quantities_by_name(run):
    snapshot = run[-1]
    v, sigma = snapshot.v.astype(float), snapshot.cauchy_stress.astype(float)
    along = v.shape[1] == 1  # a line, on which a velocity has a sign
    np.testing.assert_allclose(quantity(snapshot, "velocity").values, v[:, 0] if along else np.linalg.norm(v, axis=1))
    assert quantity(snapshot, "velocity").label == ("velocity [m/s]" if along else "|velocity| [m/s]")
    np.testing.assert_array_equal(quantity(snapshot, "velocity.x").values, v[:, 0])
    np.testing.assert_array_equal(quantity(snapshot, "cauchy_stress.xz").values, sigma[:, 0, 2])
    np.testing.assert_array_equal(quantity(snapshot, "J").values, snapshot.J)
    mises = np.sqrt(
        0.5 * ((sigma[:, 0, 0] - sigma[:, 1, 1]) ** 2 + (sigma[:, 1, 1] - sigma[:, 2, 2]) ** 2)
        + 0.5 * (sigma[:, 2, 2] - sigma[:, 0, 0]) ** 2
        + 3.0 * (sigma[:, 0, 1] ** 2 + sigma[:, 1, 2] ** 2 + sigma[:, 0, 2] ** 2)
    )
    np.testing.assert_allclose(quantity(snapshot, "von_mises").values, mises, rtol=1e-6, atol=1e-6 * mises.max())
    assert quantity(snapshot, "von_mises").label == "von Mises stress [Pa]"
    for name in ("velocty", "velocity.q", "velocity.xx", "J.x", "cauchy_stress.x", ""):
        with pytest.raises(ValueError, match="got "):
            quantity(snapshot, name)


def test_cells_are_those_of_the_deformation():
    """Corners of a sheared cell, and cells of a lattice that tile it."""
    from warp_eulsph.geometry import box

    class Sheared:
        units: ClassVar = {"deformation_gradient": "-"}

    x, volume = box((0.0, 0.0), (1.0, 2.0), 0.25)
    F = np.array([[1.0, 0.5], [0.0, 1.0]])
    snapshot = Sheared()
    snapshot.x, snapshot.F = x @ F.T, np.tile(F, (len(x), 1, 1))
    assert spacing(x) == pytest.approx(0.25)
    cells = corners(snapshot, 0.25)
    np.testing.assert_allclose(cells.min(axis=(0, 1)), [0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(cells.max(axis=(0, 1)), [2.0, 2.0])
    areas = np.cross(
        np.pad(cells[:, 1] - cells[:, 0], ((0, 0), (0, 1))), np.pad(cells[:, 2] - cells[:, 0], ((0, 0), (0, 1)))
    )
    np.testing.assert_allclose(areas[:, 2], volume)
    # Where the frame says how much particles hold, each is drawn as large as that.
    snapshot.units = {"deformation_gradient": "-", "volume": "m^d"}
    type(snapshot).__getitem__ = lambda self, name: np.linspace(0.1, 0.2, len(x))
    cells = corners(snapshot, 0.25)
    sides = cells[:, 1] - cells[:, 0], cells[:, 2] - cells[:, 0]
    np.testing.assert_allclose(np.linalg.det(np.stack(sides, axis=1)), np.linspace(0.1, 0.2, len(x)))


def test_picture_shows_the_values(run, tmp_path):
    path = picture(run[-1], tmp_path / "new" / "a.png", Picture(field="velocity", size=(400, 300)))
    first = image(path)
    assert first.shape == (300, 400, 3) and first.std() > 10.0
    other = picture(run[-1], tmp_path / "b.png", Picture(field="velocity.x", size=(400, 300)))
    assert (image(other) != first).any()
    again = picture(run[-1], tmp_path / "c.png", Picture(field="velocity", size=(400, 300)))
    np.testing.assert_array_equal(image(again), first)


def test_film_shows_every_snapshot(run, tmp_path):
    from PIL import Image

    path = film(run, tmp_path / "a.gif", Picture(size=(300, 200)), fps=5.0)
    with Image.open(path) as shown:
        assert shown.n_frames == 4 and shown.size == (300, 200)
        assert shown.info["duration"] == 200
        frames = []
        for k in range(4):
            shown.seek(k)
            frames.append(np.asarray(shown.convert("RGB")).astype(int))
    assert all((a != b).any() for a, b in itertools.pairwise(frames))


def test_film_of_nothing_is_refused(run, tmp_path):
    with pytest.raises(ValueError, match="at least one frame"):
        film(run, tmp_path / "a.gif", frames=[])


def test_film_as_mp4_needs_ffmpeg(run, tmp_path, monkeypatch):
    import imageio_ffmpeg

    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    with monkeypatch.context() as without:
        without.setitem(sys.modules, "imageio_ffmpeg", None)
        with pytest.raises(
            FileNotFoundError, match="needs the program ffmpeg; install it or pip install imageio-ffmpeg"
        ):
            film(run, tmp_path / "a.mp4")
    assert film(run, tmp_path / "a.mp4", Picture(size=(300, 200))).stat().st_size > 1000  # by the package's own
    program = tmp_path / "bin" / "ffmpeg"
    program.symlink_to(imageio_ffmpeg.get_ffmpeg_exe())
    path = film(run, tmp_path / "a.mp4", Picture(size=(301, 201)), fps=2.0)
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert frames == 4 and seconds == pytest.approx(2.0, abs=0.1)
    assert next(imageio_ffmpeg.read_frames(str(path)))["size"] == (300, 200)  # the encoder takes even sides only
    program.unlink()
    program.write_text("#!/bin/sh\necho no room >&2\nexit 1\n")
    program.chmod(0o755)
    with pytest.raises(OSError, match="ffmpeg failed: no room"):
        film(run, tmp_path / "b.mp4", Picture(size=(300, 200)))
    assert not (tmp_path / "b.mp4").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"size": (10, 300)}, "size must be 100 to 10000 pixels"),
        ({"limits": (1.0, 1.0)}, "limits must be a least and a larger value"),
        ({"view": (0.0, 0.0, 0.0)}, "view must be three finite numbers, not all zero"),
    ],
)
def test_options_of_pictures_are_checked(options, message):
    with pytest.raises(ValueError, match=message):
        Picture(**options)


def test_missing_libraries_are_named(run, tmp_path, monkeypatch):
    snapshot = run[0]
    missing = {1: "matplotlib.figure", 2: "matplotlib.figure", 3: "pyvista"}[snapshot.x.shape[1]]
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'warp_eulsph\[viz\]'"):
        picture(snapshot, tmp_path / "a.png")


# the commands


def test_commands_draw_and_export(run, tmp_path, capsys):
    small = ["--size", "300,200"]
    assert main(["plot", str(run.directory.path), "-o", str(tmp_path / "a.png"), "-f", "J", *small]) == 0
    assert (
        main(
            ["plot", str(run.directory.path), "-o", str(tmp_path / "a.gif"), "--frames", "::3", "--limits=-1,1", *small]
        )
        == 0
    )
    assert (
        main(["plot", str(run.directory.path), "-o", str(tmp_path / "b.png"), "--view=1,0,0", "--frames", "0", *small])
        == 0
    )
    assert (
        main(["export", str(run.directory.path), str(tmp_path / "a.npz"), "-f", "velocity,J", "--frames", "1:3"]) == 0
    )
    assert set(np.load(tmp_path / "a.npz")) == {"time", "step", "x", "velocity", "J"}
    assert capsys.readouterr().out.split() == [str(tmp_path / name) for name in ("a.png", "a.gif", "b.png", "a.npz")]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["plot", "nowhere"], "no run in nowhere"),
        (["plot", "RUN", "-f", "speed"], "a picture must be coloured by one of"),
        (["plot", "RUN", "-o", "a.jpg"], "the ending must be .png, .gif or .mp4"),
        (["plot", "RUN", "--frames", ":"], "a PNG shows one frame, --frames : are 4"),
        (["plot", "RUN", "-o", "a.gif", "--fps", "0"], "frames per second must be positive"),
        (["export", "RUN", "a.txt"], "a.txt: the ending must be one of"),
        (["export", "RUN", "a.npz", "--frames", "7"], "frames must be such as"),
    ],
)
def test_bad_commands_exit_2_with_one_line(run, arguments, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main([str(run.directory.path) if word == "RUN" else word for word in arguments]) == 2
    shown = capsys.readouterr().err
    assert message in shown and "Traceback" not in shown
    assert not [path for path in tmp_path.iterdir() if path.suffix in (".png", ".gif", ".npz")]


def test_unknown_colours_are_named(run, capsys, tmp_path):
    dim = run[0].x.shape[1]
    status = main(["plot", str(run.directory.path), "--colours", "nocolour", "-o", str(tmp_path / "a.png")])
    # A line needs no colours.
    assert (status, "nocolour" in capsys.readouterr().err) == ((0, False) if dim == 1 else (2, True))


def test_malformed_options_exit_2(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["plot", "x", "--limits", "1"])
    assert ended.value.code == 2 and "must be 2 numbers with commas" in capsys.readouterr().err


def test_schema_command_prints_the_schema(capsys):
    import json

    assert main(["schema"]) == 0
    assert json.loads(capsys.readouterr().out)["$defs"]["Case"]["properties"]["until"]["description"] == "end time [s]"


# what a picture looks like


def test_no_cracks_between_cells_and_a_page_that_suits(tmp_path):
    """A sheared and jittered block: no pixel within it is the page's white."""
    simulation = plate()
    rng = np.random.default_rng(1)
    F = simulation.F + 0.03 * rng.uniform(-1, 1, simulation.F.shape)
    simulation.stepper.U.F.assign(simulation.order.by_place(F))
    simulation.run(0.0, output=tmp_path / "run")
    frame = Run(tmp_path / "run")[-1]
    shown = image(picture(frame, tmp_path / "a.png", Picture(field="J")))
    coloured = (shown.astype(int).max(axis=2) - shown.min(axis=2)) > 30
    rows, columns = np.flatnonzero(coloured[:, : 2 * shown.shape[1] // 3].any(axis=1)), coloured[:, :].any(axis=0)
    left = np.flatnonzero(columns)[0]
    right = left + np.flatnonzero(~columns[left:])[0]
    middle = shown[rows[0] + 30 : rows[-1] - 30, left + 30 : right - 30]
    assert middle[..., 0].size > 50_000 and middle.min(axis=2).max() < 180  # white has all three colours


@pytest.mark.parametrize(
    ("sides", "expected"),
    [
        ((1.0, 6.0), (380, 700)),
        ((1.0, 1.0), (800, 700)),
        ((10.0, 1.0), (1100, 300)),
        ((1.0, 6.0, 1.0), (700, 700)),
        ((6.0, 1.0, 1.0), (950, 700)),
    ],
)
def test_pages_are_upright_for_columns_and_flat_for_beams(sides, expected):
    assert suited(np.array([np.zeros(len(sides)), sides])) == expected


def test_title_and_first_outline(run, tmp_path):
    plain, titled = (Picture(size=(400, 300), title=title) for title in ("", "Title"))
    first, second = (
        image(picture(run[-1], tmp_path / "a.png", plain)),
        image(picture(run[-1], tmp_path / "b.png", titled)),
    )
    assert (first != second).any()
    start = run[0].x.astype(float)
    rims = rim(start)
    if start.shape[1] != 2:
        assert rims is None
        return
    side = np.sqrt(len(start))
    assert len(rims) == 4 * side - 4  # the outermost layer of a square lattice
    outlined = image(picture(run[-1], tmp_path / "c.png", Picture(size=(400, 300), outline=rims)))
    assert (outlined != first).any()


class Twisted:
    """A frame of two squares of 12 × 12, each turned by ``most`` r² about its middle."""

    units: ClassVar[dict[str, str]] = {"x": "m", "deformation_gradient": "-", "body": "-", "volume": "m^2", "J": "-"}
    time = 0.0

    def __init__(self, most):
        X, turn = lattice(2, 12) - 0.5, np.array([[0.0, -1.0], [1.0, 0.0]])
        angle = most * (X**2).sum(axis=1)
        R = np.cos(angle)[:, None, None] * np.eye(2) + np.sin(angle)[:, None, None] * turn
        x, F = np.einsum("nij,nj->ni", R, X), R + 2.0 * most * np.einsum("nij,jk,nk,nl->nil", R, turn, X, X)
        apart = np.array([1 + 1 / 12, 0.0])
        self.start, self.x, self.F = np.r_[X, X + apart], np.r_[x, x + 2.0 * apart], np.r_[F, F]
        self.body, self.volume, self.J = np.repeat([0, 1], 144), np.full(288, 1 / 144), np.r_[angle, angle]

    def __getitem__(self, name):
        return getattr(self, name)

    field = __getitem__


def test_what_opens_between_cells_is_filled():
    frame = Twisted(8.0)
    triangles = sheet(frame, frame.start)
    assert len(triangles) == 2 * 2 * 11 * 11 and (frame.body[triangles] == frame.body[triangles][:, :1]).all()
    frame.x[:144] += 9.0 * np.random.default_rng(0).uniform(-1, 1, (144, 2))  # a liquid that has been stirred
    assert 242 <= len(sheet(frame, frame.start)) < 270
    assert len(sheet(frame, frame.start[:-1])) == 0  # a frame of other particles

    def white(**options):
        frame = Twisted(8.0)
        shown = draw_frame(frame, fitted(Picture(field="J", size=(800, 400), **options), [frame]))
        return (shown.min(axis=2) == 255).sum()

    assert white(start=frame.start) < white() - 1000
