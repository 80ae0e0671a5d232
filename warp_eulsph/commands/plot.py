"""``warp-eulsph plot``: a picture or a film of a run."""

import argparse
from typing import Any

from .frames import chosen, complain

ENDINGS = "a .png shows one frame, a .gif or, where ffmpeg is, an .mp4 all of them"


def add(commands: argparse._SubParsersAction) -> None:
    """Describe the subcommand."""
    parser = commands.add_parser(
        "plot",
        help="draw a run: PNG, animated GIF, MP4",
        description=f"Draw a run; {ENDINGS}. Exit status: 0 drawn, 2 wrong input or a library that is missing.",
    )
    parser.add_argument("directory", metavar="RUN", help="directory of a run")
    parser.add_argument("-o", "--output", default="picture.png", metavar="FILE", help=f"{ENDINGS}; default %(default)s")
    parser.add_argument(
        "-f",
        "--field",
        help="what colours the particles: a field, the length of a vector, velocity.x, cauchy_stress.xy or von_mises; "
        "default velocity, or the first field that there is",
    )
    parser.add_argument("--frames", metavar="WHICH", help="such as -1, 0,5,10 or ::2; default -1 for a PNG, else all")
    parser.add_argument(
        "--limits", type=_numbers(2), metavar="LOW,HIGH", help="range of the colours; default all of it"
    )
    parser.add_argument("--colours", default="viridis", help="colour map of matplotlib; default %(default)s")
    parser.add_argument("--size", type=_numbers(2, int), metavar="W,H", help="pixels; default those that suit the body")
    parser.add_argument("--view", type=_numbers(3), metavar="X,Y,Z", help="where 3-D is looked at from; y points up")
    parser.add_argument("--title", help="stands before the time; default the title of the case")
    parser.add_argument("--undeformed", action="store_true", help="dots where the outermost particles started, in 2-D")
    parser.add_argument("--fps", type=float, default=10.0, help="frames per second of a film; default %(default)s")
    parser.add_argument(
        "--watch",
        nargs="?",
        type=float,
        const=2.0,
        metavar="SECONDS",
        help="draw the last snapshot into the PNG whenever there is a new one, looking this often (default 2), until "
        "the run ends or Ctrl-C; a viewer that reloads the file shows the run as it goes on",
    )
    parser.set_defaults(run_command=run)


def run(arguments: argparse.Namespace) -> int:
    """Draw; 0, or 2 when it cannot be."""
    from ..output import Run
    from ..pictures import film, picture
    from .watch import watch

    def draw(found: Run, path: str) -> None:
        picture(found[-1], path, _options(found, arguments))

    try:
        single = arguments.output.endswith(".png")
        if not arguments.output.endswith((".png", ".gif", ".mp4")):
            raise ValueError(f"the ending must be .png, .gif or .mp4, got {arguments.output!r}")
        if arguments.watch is not None:
            if not single or arguments.frames is not None or not arguments.watch > 0.0:
                raise ValueError("--watch draws the last frame into a .png, looking every so many seconds, more than 0")
            watch(arguments.directory, arguments.output, draw, arguments.watch)
            return 0
        found = Run(arguments.directory)
        frames = chosen(len(found), arguments.frames or ("-1" if single else ":"))
        if single and len(frames) > 1:
            raise ValueError(f"a PNG shows one frame, --frames {arguments.frames} are {len(frames)}; choose a .gif")
        options = _options(found, arguments)
        if single:
            path = picture(found[frames[0]], arguments.output, options)
        else:
            path = film(found, arguments.output, options, frames=frames, fps=arguments.fps)
    except (ValueError, OSError, KeyError, ModuleNotFoundError) as error:
        return complain(error)
    except KeyboardInterrupt:
        return 0 if arguments.watch is not None else 130
    print(path)
    return 0


def _options(found: Any, arguments: argparse.Namespace) -> Any:
    """What the picture looks like, a ``Picture``."""
    from ..pictures import Picture, default_field
    from ..pictures.cells import rim, spacing

    first = found[0]
    view = {} if arguments.view is None else {"view": arguments.view}
    return Picture(
        field=arguments.field or default_field(first),
        size=arguments.size,
        colours=arguments.colours,
        limits=arguments.limits,
        spacing=spacing(first.x),
        title=found.title if arguments.title is None else arguments.title,
        outline=rim(first.x) if arguments.undeformed else None,
        start=first.x,
        **view,
    )


def _numbers(count: int, kind: type = float):
    def parse(text: str) -> tuple:
        try:
            values = tuple(kind(part) for part in text.split(","))
        except ValueError:
            values = ()
        if len(values) != count:
            raise argparse.ArgumentTypeError(f"must be {count} numbers with commas between them, got {text!r}")
        return values

    return parse
