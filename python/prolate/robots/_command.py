"""The command ``prolate-robot``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from .._errors import Error
from ._command_bake import add_bake, add_convert, add_render, add_touch, add_view
from ._command_read import BAD_INPUT, DONE, INTERNAL, INTERRUPTED, IO, USAGE, add_info

_CODES = {"bad_options": USAGE, "io": IO, "out_of_memory": IO, "unsupported": USAGE, "internal": INTERNAL}

_FOOTER = """\
examples:
  prolate-robot info panda.urdf
  prolate-robot bake panda.urdf --clearance 5mm
  prolate-robot convert talos.urdf --package talos_data=/opt/robots/talos_data -o talos.xml
  prolate-robot view panda.urdf -o panda.html
  prolate-robot render panda.urdf -o panda.png --q 0,-0.8,0,-2.4,0,1.6,0.8,0.04
  prolate-robot touch panda.urdf -o panda.srdf

exit codes: 0 done, 1 done but for some links, which are named, 2 wrong usage, 3 nothing of a robot can be read, 4
reading or writing failed, 5 an error in prolate itself, 130 interrupted.
'prolate-robot COMMAND --help' describes a command."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command, and return its exit code."""
    options = _parser().parse_args(arguments)
    try:
        return int(options.run(options))
    except Error as error:
        print(f"prolate-robot: {error}", file=sys.stderr)
        return _CODES.get(error.code, BAD_INPUT)
    except (ValueError, TypeError) as error:
        print(f"prolate-robot: {error}", file=sys.stderr)
        return USAGE
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:  # of a reader that has seen enough, such as head
        sys.stderr.close()
        return DONE
    except OSError as error:
        print(f"prolate-robot: {error.filename or ''}: {error.strerror}", file=sys.stderr)
        return IO


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="prolate-robot",
        description="Reads robots in URDF, xacro, MJCF and SDF, covers their links, and writes them for simulators and "
        "planners. Every cover is proved to hold its link.",
        epilog=_FOOTER,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    for add in (add_info, add_bake, add_convert, add_view, add_render, add_touch):
        add(commands)
    return parser


if __name__ == "__main__":
    sys.exit(main())
