"""``bake``, ``convert``, ``view``, ``render`` and ``touch`` of ``prolate-robot``."""

from __future__ import annotations

import argparse
import io
import os
import sys
from typing import TYPE_CHECKING, Any

from .._errors import Error
from .._mesh import length
from ._command_read import DONE, NO, add_command, load_as, pair, say
from ._writing import Files

if TYPE_CHECKING:
    from ._baked import BakedRobot
    from ._robot import Robot

_ENDINGS = {".xml": "mjcf", ".sdf": "sdf", ".urdf": "urdf", ".yaml": "spheres", ".yml": "spheres"}


def add_bake(commands: Any) -> None:
    bake = add_command(
        commands,
        "bake",
        _bake,
        "cover the links, and say how well",
        "Covers each link by what is best for it, and prints a line for each: which kind of bodies, how many, how much "
        "of them is outside the meshes (of their volume), how far they stick out at most and on average, and whether "
        "the cover is proved. Results are kept in the cache, where other commands find them.",
    )
    _add_goals(bake)


def add_convert(commands: Any) -> None:
    convert = add_command(
        commands,
        "convert",
        _convert,
        "write the robot with covers, for a simulator or a planner",
        "Covers each link and writes the robot anew, whole or not at all; meshes go into a folder beside the file. "
        "If a link is missing something, that is named, and the robot is not written.",
    )
    convert.add_argument("-o", "--output", metavar="FILE", required=True, help="where to; replaced if it is there")
    convert.add_argument(
        "--to",
        choices=["mjcf", "sdf", "urdf", "drake", "spheres"],
        help="mjcf: MuJoCo. sdf: Gazebo, Drake. urdf: meshes stand for ellipsoids. drake: URDF with drake:ellipsoid. "
        "spheres: cuRobo's YAML, with --only spheres. By default what the ending says: .xml, .sdf, .urdf, .yaml",
    )
    convert.add_argument("--floating", action="store_true", help="let the root move freely (mjcf, sdf)")
    convert.add_argument("--no-visuals", action="store_true", help="leave out what is only seen")
    _add_goals(convert)


def add_view(commands: Any) -> None:
    view = add_command(
        commands,
        "view",
        _view,
        "make a page that shows the robot and its covers",
        "Writes one page of HTML that needs no network: joints can be moved, links that touch turn red, colours say "
        "how far covers stick out, and a table lists the links.",
    )
    view.add_argument("-o", "--output", metavar="PAGE.html", required=True, help="where to; replaced if it is there")
    _add_goals(view)


def add_render(commands: Any) -> None:
    render = add_command(
        commands,
        "render",
        _render,
        "draw the robot and its covers",
        "Draws one picture, as a PNG: covers transparent over meshes, or coloured by how far they stick out. Links "
        "that may touch are red.",
    )
    render.add_argument(
        "-o", "--output", metavar="PICTURE.png", required=True, help="where to; replaced if it is there"
    )
    render.add_argument("--q", metavar="Q", type=_numbers, help="--q=0.1,-0.5: the configuration; else its home")
    render.add_argument("--size", metavar="W,H", type=_numbers, default=(1200, 900), help="pixels (1200,900)")
    render.add_argument(
        "--from",
        metavar="AZIMUTH,ELEVATION",
        dest="view",
        type=_numbers,
        default=(-50, 20),
        help="degrees (--from=-50,20)",
    )
    render.add_argument("--covers", choices=["colour", "heat", "none"], default="colour", help="(%(default)s)")
    render.add_argument("--no-meshes", action="store_true", help="covers alone")
    _add_goals(render)


def add_touch(commands: Any) -> None:
    touch = add_command(
        commands,
        "touch",
        _touch,
        "find which links touch always, sometimes or never",
        "Samples configurations within the joints' limits, and prints for each pair of links that touches how often "
        "its meshes do and its covers do. 'new' marks pairs that only covers bring into contact: --mend covers these "
        "links more closely, where excluding the pair would hide real contacts.",
    )
    touch.add_argument("-o", "--output", metavar="FILE", help="SRDF, with the pairs that need no check")
    touch.add_argument("--samples", type=int, default=10_000, help="how many configurations (%(default)s)")
    touch.add_argument("--seed", type=int, default=0, help="of the samples (%(default)s)")
    _add_goals(touch)


def _add_goals(parser: argparse.ArgumentParser) -> None:
    """The options of Robot.bake(), whose defaults hold for those that are not given."""
    group = parser.add_argument_group("how links are covered")
    goal = group.add_mutually_exclusive_group()
    goal.add_argument(
        "--clearance", metavar="LENGTH", help="how far covers may stick out: metres, or 5mm (the default)"
    )
    goal.add_argument("--ellipsoids", metavar="N", type=int, help="about so many bodies for the whole robot")
    goal.add_argument("--exact", action="store_true", help="keep the meshes")
    group.add_argument(
        "--only", metavar="KINDS", help="ellipsoids, spheres, hull, box, capsule, cylinder, sphere; several with commas"
    )
    group.add_argument(
        "--finer", metavar="LINK=LENGTH", type=pair, action="append", default=[], help="another clearance for a link"
    )
    group.add_argument(
        "--mend",
        metavar="ROUNDS",
        type=int,
        default=0,
        help="cover links that only covers bring into contact more closely, in so many rounds",
    )
    group.add_argument("--max-hull-vertices", metavar="N", type=int, help="of a hull, 8 or more")
    group.add_argument("--max-ellipsoids", metavar="N", type=int, help="of a link, for a clearance")
    group.add_argument("--quality", choices=["fast", "normal", "best"], help="of the search for ellipsoids")
    group.add_argument("--cache", metavar="FOLDER", default=_cache_folder(), help="what was baked before (%(default)s)")
    group.add_argument("--no-cache", action="store_true", help="bake anew, and keep nothing")
    group.add_argument("--threads", metavar="N", type=int, default=0, help="0, the default: all cores")


def _cache_folder() -> str:
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return os.path.join(home, "prolate", "robots")


def _robot(options: argparse.Namespace, visuals: bool) -> Robot:
    from ._robot import Robot

    _check(options)
    return Robot(load_as(options, visuals))


def _baked(robot: Robot, options: argparse.Namespace) -> BakedRobot:
    from ._touch import mend

    given: dict[str, Any] = {
        "clearance": _metres("--clearance", options.clearance),
        "ellipsoids": options.ellipsoids,
        "only": tuple(options.only.split(",")) if options.only else None,
        "max_hull_vertices": options.max_hull_vertices,
        "max_ellipsoids": options.max_ellipsoids,
        "quality": options.quality,
        "finer": {name: _metres("--finer", text) for name, text in options.finer} or None,
        "cache": None if options.no_cache else options.cache,
    }
    given = {name: value for name, value in given.items() if value is not None}
    with _Progress(options.quiet) as progress:
        given.update(threads=options.threads, progress=progress)
        baked = robot.bake(exact=options.exact, **given)
        if not options.mend:
            return baked
        exact = robot.bake(exact=True, threads=options.threads)
        more = {name: value for name, value in given.items() if name not in ("clearance", "ellipsoids", "finer")}
        return mend(exact, baked, rounds=options.mend, **more)[0]


def _check(options: argparse.Namespace) -> None:
    """What would else come up only when the work is done."""
    output = getattr(options, "output", None)
    for given in (options.robot, options.srdf):
        if output and given and os.path.realpath(output) == os.path.realpath(given):
            raise ValueError(f"--output: {output} is read, too; choose another name")
    if options.mend < 0:
        raise ValueError(f"--mend: must be 0 or more, not {options.mend}")


def _metres(option: str, text: str | None) -> float | None:
    """Of a number, or of a text such as 5mm."""
    try:
        return None if text is None else float(text)
    except ValueError:
        return length(option, text)


def _outcome(robot: BakedRobot, quiet: bool) -> int:
    return say([*robot.description.notes, *robot.notes], quiet) or (DONE if robot.proved else NO)


def _bake(options: argparse.Namespace) -> int:
    robot = _baked(_robot(options, visuals=False), options)
    print(robot.table())
    return _outcome(robot, options.quiet)


def _convert(options: argparse.Namespace) -> int:
    kind = options.to or _ENDINGS.get(os.path.splitext(options.output)[1].lower())
    if kind is None:
        raise ValueError(f"--output: {options.output} has no ending that says the format; say which with --to")
    robot = _baked(_robot(options, visuals=not options.no_visuals), options)
    if not options.quiet:
        print(robot.table())
    code = _outcome(robot, options.quiet)
    if code == DONE:
        _write(robot, kind, options)
    else:
        print(f"prolate-robot: {options.output}: not written, as something is missing", file=sys.stderr)
    return code


def _write(robot: BakedRobot, kind: str, options: argparse.Namespace) -> None:
    from ._write_mjcf import write_mjcf
    from ._write_sdf import write_sdf
    from ._write_spheres import write_spheres
    from ._write_urdf import write_urdf

    visuals = not options.no_visuals
    if kind == "mjcf":
        write_mjcf(robot, options.output, floating=options.floating, visuals=visuals)
    elif kind == "sdf":
        write_sdf(robot, options.output, floating=options.floating, visuals=visuals)
    elif kind == "spheres":
        write_spheres(robot, options.output)
    else:
        write_urdf(robot, options.output, ellipsoids="drake" if kind == "drake" else "mesh", visuals=visuals)


def _view(options: argparse.Namespace) -> int:
    from ._view import write_view

    robot = _baked(_robot(options, visuals=False), options)
    write_view(robot, options.output)
    return _outcome(robot, options.quiet)


def _render(options: argparse.Namespace) -> int:
    try:
        from PIL import Image
    except ImportError:
        raise Error("pictures are written by Pillow: pip install pillow", "unsupported") from None
    from ._render import render

    if len(options.size) != 2 or len(options.view) != 2:
        raise ValueError("--size and --from: must be two numbers, with a comma")
    robot = _baked(_robot(options, visuals=False), options)
    width, height = map(int, options.size)
    pixels = render(
        robot, options.q, size=(width, height), view=options.view, covers=options.covers, meshes=not options.no_meshes
    )
    png = io.BytesIO()
    Image.fromarray(pixels).save(png, "png")
    files = Files.at(options.output)
    files.contents[files.path] = png.getvalue()
    files.write()
    return _outcome(robot, options.quiet)


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be numbers with commas, not {text!r}") from None


def _touch(options: argparse.Namespace) -> int:
    from ._touch import touches

    robot = _robot(options, visuals=False)
    baked, exact = _baked(robot, options), robot.bake(exact=True, threads=options.threads)
    found = touches(exact, baked, samples=options.samples, seed=options.seed, threads=options.threads)
    print(found.table())
    if options.output:
        found.save(options.output)
    return _outcome(baked, options.quiet)


class _Progress:
    """A line on a terminal that says how far the bake is."""

    def __init__(self, quiet: bool) -> None:
        self.shown = not quiet and sys.stderr.isatty()

    def __enter__(self) -> _Progress:
        return self

    def __call__(self, done: int, count: int) -> None:
        if self.shown:
            print(f"\r{done} of {count} links", end="", file=sys.stderr, flush=True)

    def __exit__(self, *_: object) -> None:
        if self.shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
