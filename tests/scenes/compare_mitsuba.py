#!/usr/bin/env python3
"""Compare the integrators of etendue with each other and with Mitsuba 3 on the shared scenes.

All renderers read the same file with two changes: a small film with a box filter, so that pixels are
independent, and the integrator. Each makes several independent images. Compared are the mean of the
image and its tiles, by Welch's t-test (see agreement.py). The table goes to the terminal, everything
to a JSON file that later runs add to.

A disagreement is a question, not a verdict: where paths are found by rare chance (caustics under path
tracing), the means of a few runs, and their spread, are both too small.
"""

import argparse
import json
import os
import pathlib
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

import agreement

# File, and the integrators that make every path of the scene, in practice too: a light path cannot
# reach a pinhole through smooth glass or over a mirror, and seldom through or over what is nearly smooth.
EVERY = ("path", "bdpt", "light")
SCENES = {
    "cornell-box": ("cornell-box-mts3/scene_v3.xml", EVERY),
    "yard-cornell": (agreement.ROOT / "scenes/yard-cornell.xml", EVERY),
    "yard-ring": (agreement.ROOT / "scenes/yard-ring.xml", EVERY),
    "veach-bidir": ("veach-bidir-mts3/scene.xml", EVERY[:2]),
    "veach-ajar": ("veach-ajar-mts3/scene.xml", EVERY[:2]),
    "staircase2": ("staircase2-mts3/scene.xml", EVERY[:2]),
    "staircase2-principled": ("staircase2-mts3/scene_principled_floor.xml", EVERY[:2]),
    "living-room": ("living-room-mts06/scene.xml", EVERY[:2]),
    "cbox-with-bulb": ("cbox-with-bulb-mts06/scene.xml", EVERY[:2]),
    "tire": ("tire-mts3/scene.xml", EVERY[:2]),
    "sms-ring": ("sms-ring-mts3/ring.xml", EVERY[:2]),
    "sms-plane": ("sms-plane-mts3/plane.xml", EVERY[:2]),
}
# Lamps so small that path tracing finds no caustic in a reasonable time: the same scene with lamps
# larger by this factor, and as much darker by its square, is compared besides.
LAMP_FACTOR = {"sms-ring": 12, "sms-plane": 20}
LARGE = "-large-lamp"


class Case:
    """A scene prepared for both renderers in a folder of its own."""

    def __init__(self, name, file, folder, args, lamp_factor=1):
        self.name = name
        tree = ElementTree.parse(file)
        scene = tree.getroot()
        snake = int(scene.get("version").split(".")[0]) >= 2
        defaults = {d.get("name"): d.get("value") for d in scene.iter("default")}

        def resolve(value):
            return defaults[value[1:]] if value.startswith("$") else value

        film = scene.find("sensor/film")
        numbers = {e.get("name"): e for e in film.findall("integer")}
        width, height = (int(resolve(numbers[k].get("value"))) for k in ("width", "height"))
        self.width = args.width
        self.height = max(1, round(height * args.width / width))
        for child in film.findall("integer") + film.findall("rfilter"):
            film.remove(child)
        for key, value in (("width", self.width), ("height", self.height)):
            ElementTree.SubElement(film, "integer", name=key, value=str(value))
        ElementTree.SubElement(film, "rfilter", type="box")

        depth_name = "max_depth" if snake else "maxDepth"
        old = scene.find("integrator")
        depth = [resolve(e.get("value")) for e in old if e.get("name") == depth_name]
        self.max_depth = args.max_depth or int(depth[0] if depth else -1)
        scene.remove(old)
        integrator = ElementTree.SubElement(scene, "integrator", type="path")
        ElementTree.SubElement(
            integrator, "integer", name=depth_name, value=str(self.max_depth)
        )

        if lamp_factor != 1:
            self.enlarge_lamps(scene, lamp_factor)
        folder.mkdir()
        for entry in file.parent.iterdir():
            (folder / entry.name).symlink_to(entry)
        self.ours = folder / "compare-etendue.xml"
        tree.write(self.ours)
        agreement.adapt_to_mitsuba(scene, integrator, folder)
        self.theirs = folder / "compare-mitsuba.xml"
        tree.write(self.theirs)

    @staticmethod
    def enlarge_lamps(scene, factor):
        for shape in scene.iter("shape"):
            radiance = shape.find("emitter/*[@name='radiance']")
            if radiance is not None:
                scale = ElementTree.Element("scale", value=str(factor))
                shape.find("transform").insert(0, scale)
                radiance.set("value", str(float(radiance.get("value")) / factor**2))


def renderer_line(name, result):
    error = 100 * result["error"] / result["mean"]
    return f"{name:22}{result['renderer']:9}{result['spp']:7}{result['mean']:11.5f} ±{error:5.2f} %"


def comparison_line(other, c):
    low, high = c["ratio_99"]
    rgb = ", ".join(f"{x:.4f}" for x in c["ratio_rgb"])
    return (
        f"{'':8}against {other:9} ratio {c['ratio']:.4f} [{low:.4f}, {high:.4f}] p {c['p']:.3f}"
        f"  tiles failed {c['tiles_failed']}/{c['tiles']} (p {c['smallest_tile_p']:.1e})  RGB {rgb}"
    )


def markdown_tables(report):
    """The figures of a report for docs/agreement.md."""

    def row(*cells):
        return "| " + " | ".join(cells) + " |"

    def mean(r):
        return f"{r['mean']:.4f} ± {100 * r['error'] / r['mean']:.2f} % ({r['spp']})"

    def verdict(c):
        low, high = c["ratio_99"]
        return f"{c['ratio']:.4f} ({low:.3f} – {high:.3f}), {c['tiles_failed']}"

    names = ("mitsuba", "path", "bdpt", "light")
    pairs = [("path", "mitsuba"), ("bdpt", "mitsuba"), ("bdpt", "path"), ("light", "path")]
    scenes = {
        name: {r["renderer"]: r for r in scene["renderers"]}
        for name, scene in report["scenes"].items()
    }
    lines = [row("scene", "size", *names), row(*["---"] * (2 + len(names)))]
    for name, r in scenes.items():
        size = "{}×{}".format(*report["scenes"][name]["size"])
        lines.append(row(name, size, *(mean(r[k]) if k in r else "" for k in names)))
    lines += ["", row("scene", *(f"{a} / {b}" for a, b in pairs)), row(*["---"] * (1 + len(pairs)))]
    for name, r in scenes.items():
        cells = (verdict(r[a]["against"][b]) if a in r and b in r else "" for a, b in pairs)
        lines.append(row(name, *cells))
    return "\n".join(lines)


def run_scene(case, renderers, seconds, args):
    """Renders with all renderers; compares each with the first, and with Mitsuba."""
    images, results = {}, []
    for renderer in renderers:
        if isinstance(renderer, agreement.Mitsuba):
            renderer.open(case.theirs)
        else:
            renderer.open(case.ours, f"max_depth={case.max_depth}")
        images[renderer.name], spp = agreement.independent_runs(renderer, args.runs, seconds)
        mean, error = agreement.mean_and_error(images[renderer.name])
        result = {"renderer": renderer.name, "spp": spp * args.runs, "mean": mean, "error": error}
        result["against"] = {
            other: agreement.compare(images[renderer.name], images[other])
            for other in list(images)[:-1]
        }
        print(renderer_line(case.name, result))
        for other, comparison in result["against"].items():
            print(comparison_line(other, comparison), flush=True)
        results.append(result)
        if args.pictures:
            os.makedirs(args.pictures, exist_ok=True)
            picture = pathlib.Path(args.pictures) / f"{case.name}-{renderer.name}.exr"
            agreement.write_image(picture, images[renderer.name].mean(axis=0))
    return results


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    known = [*SCENES, *(name + LARGE for name in LAMP_FACTOR)]
    parser.add_argument("scenes", nargs="*", help=f"some of: {', '.join(known)}, or files")
    agreement.add_arguments(parser)
    parser.add_argument("--integrators", help="integrators of etendue, such as path,bdpt (default: depends on the scene)")
    parser.add_argument("--no-mitsuba", action="store_true", help="render with etendue only")
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--runs", type=int, default=16)
    parser.add_argument("--seconds", type=float, default=60, help="seconds for all runs of a renderer")
    parser.add_argument("--max-depth", type=int, help="longest path in edges, instead of that of the file")
    parser.add_argument("--pictures", help="folder for the mean image of each renderer")
    parser.add_argument("--table", action="store_true", help="only print the JSON file as tables")
    args = parser.parse_args()
    if args.table:
        print(markdown_tables(json.loads(args.json.read_text())))
        return
    agreement.ensure_packages()

    root = os.environ.get("ETENDUE_SCENES", agreement.ROOT.parent / "shared" / "scenes")
    mitsuba = agreement.Mitsuba(args)
    names = args.scenes or known
    report = agreement.earlier_report(args, "scenes")
    report["mitsuba"] = mitsuba.version
    with tempfile.TemporaryDirectory() as temporary:
        temporary = pathlib.Path(temporary)
        for name in names:
            base = name.removesuffix(LARGE)
            file, integrators = SCENES.get(base, (pathlib.Path(name).resolve(), EVERY[:2]))
            file = pathlib.Path(root) / file
            if not file.exists():
                sys.exit(f"compare-mitsuba: {file} not found; scenes: {', '.join(known)}")
            name = name if base in SCENES else file.stem
            if args.integrators:
                integrators = args.integrators.split(",")
            factor = LAMP_FACTOR[base] if name.endswith(LARGE) else 1
            case = Case(name, file, temporary / name, args, factor)
            renderers = [] if args.no_mitsuba else [mitsuba]
            renderers += [agreement.Etendue(i, args, temporary) for i in integrators]
            results = run_scene(case, renderers, args.seconds, args)
            report["scenes"][name] = {
                "size": [case.width, case.height],
                "max_depth": case.max_depth,
                "runs": args.runs,
                "renderers": results,
            }
            args.json.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main()
