"""python -m etendue.usd scene.usd scene.xml: converts a stage to XML of Mitsuba, which the program etendue reads."""

import argparse
import sys
import warnings

from . import load


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser("python -m etendue.usd", description=__doc__)
    parser.add_argument("input", help=".usd, .usda, .usdc or .usdz file")
    parser.add_argument("output", help=".xml file; meshes go to the folder NAME_files beside it")
    parser.add_argument("--variant", action="append", default=[], metavar="PRIM:SET=NAME", help="selects a variant")
    parser.add_argument("--time", type=float, help="time code")
    parser.add_argument("--camera", help="name or path of the camera")
    parser.add_argument("--purpose", action="append", help="purpose of the prims that are read; may be given several times")
    parser.add_argument("--subdivision", type=int, default=2, help="levels of subdivision (default: 2)")
    parser.add_argument("--lenient", action="store_true", help="leaves out what is not supported")
    arguments = parser.parse_args()
    variants: dict[str, dict[str, str]] = {}
    for text in arguments.variant:
        place, _, choice = text.partition("=")
        path, _, name = place.rpartition(":")
        if not choice or not path:
            parser.error(f"--variant {text}: expected PRIM:SET=NAME")
        variants.setdefault(path, {})[name] = choice
    try:
        with warnings.catch_warnings(record=True) as notes:
            warnings.simplefilter("always")
            description = load(arguments.input, variants=variants, time=arguments.time, camera=arguments.camera,
                               purposes=arguments.purpose or ("default", "render"), subdivision=arguments.subdivision,
                               lenient=arguments.lenient)
            description.save(arguments.output)
    except (RuntimeError, ValueError, OSError) as e:
        print(f"etendue.usd: {e}", file=sys.stderr)
        return 1
    for note in notes:
        print(f"warning: {note.message}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
