#!/usr/bin/env python3
"""Compare the images of scenes in all formats with those of what `etendue convert` makes of them.

etendue renders the file itself, Mitsuba 3 the XML that `etendue convert` writes. Both trace paths of
the same greatest length. Each makes several independent images; compared are the mean of the image and
its tiles, by Welch's t-test (see agreement.py), with 0.2 % of the image's mean forgiven. Nothing is
clamped. Where `convert` warns that something is left out or replaced, the file it writes is also
rendered by etendue: its image must agree with Mitsuba's even where that of the original cannot.

A scene that is known to differ says why; it fails if it agrees.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

import agreement

TOLERANCE = 0.002
# Films wider than this are made smaller.
WIDTH = 64
# Larger images have fewer samples per pixel.
PIXELS = 32 * 24

# Scenes of which the converted file means something else to Mitsuba, and why.
DIFFERENT = {
    "mitsuba3/materials_of_materials": "Mitsuba's blendbsdf of a mirror, and normals through the surface",
    "mitsuba06/materials_of_materials": "stand-ins, of which etendue does not read one, principledthin",
}


class Converted:
    """A scene, what `convert` makes of it, and this in Mitsuba's words; in a folder of its own."""

    def __init__(self, file, folder, args):
        self.file = file
        folder.mkdir()
        self.ours = folder / "converted.xml"
        command = [args.etendue, "convert", "--lenient", str(file), str(self.ours)]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        self.warnings = [line.split(": ", 2)[-1] for line in done.stderr.splitlines()]

        tree = ElementTree.parse(self.ours)
        scene = tree.getroot()
        film = scene.find("sensor/film")
        size = {e.get("name"): e for e in film.findall("integer")}
        width, height = (int(size[name].get("value")) for name in ("width", "height"))
        self.resolution = []
        if width > WIDTH and "crop_width" not in size:
            height = max(1, round(height * WIDTH / width))
            size["width"].set("value", str(WIDTH))
            size["height"].set("value", str(height))
            width = WIDTH
            self.resolution = ["--resolution", f"{WIDTH}x{height}"]
        self.share = min(1, PIXELS / (width * height))

        integrator = scene.find("integrator")
        depth = integrator.find("integer[@name='max_depth']")
        self.max_depth = int(depth.get("value")) if depth is not None else -1
        if integrator.get("type") == "direct":
            self.max_depth = 2
        for child in list(integrator):  # also hide_emitters: nothing is hidden here
            integrator.remove(child)
        integrator.set("type", "path")
        ElementTree.SubElement(integrator, "integer", name="max_depth", value=str(self.max_depth))
        tree.write(self.ours)
        agreement.adapt_to_mitsuba(scene, integrator, folder)
        self.theirs = folder / "mitsuba.xml"
        tree.write(self.theirs)


def agrees(result):
    return result["tiles_failed"] == 0 and result["p"] >= agreement.FALSE_ALARM


def images_of(renderer, spp, args):
    import numpy as np

    return np.array([renderer.render(spp, args.seed + i) for i in range(args.runs)])


def compare_scene(file, mitsuba, ours, folder, args):
    scene = Converted(file, folder, args)
    options = [f"max_depth={scene.max_depth}"]
    mitsuba.open(scene.theirs, optimize=False)
    spp, their_spp = (max(4, round(n * scene.share)) for n in (args.spp, args.mitsuba_spp))
    theirs = images_of(mitsuba, their_spp, args)
    if not theirs.mean() > 0:
        raise RuntimeError("Mitsuba's image is black: there is nothing to compare")
    ours.more = scene.resolution
    ours.open(file, *options)
    images = images_of(ours, spp, args)
    result = {"warnings": scene.warnings, "spp": [spp * args.runs, their_spp * args.runs]}
    result |= {"mean": theirs.mean()} | agreement.compare(images, theirs, TOLERANCE)
    result["agrees"] = agrees(result)
    if scene.warnings:
        ours.open(scene.ours, *options)
        try:
            images_again = images_of(ours, spp, args)
        except RuntimeError as error:  # such as Mitsuba's principledthin, which etendue does not have
            result["converted"] = {"error": str(error).rsplit(": ", 1)[-1]}
        else:
            again = agreement.compare(images_again, theirs, TOLERANCE)
            result["converted"] = again | {"agrees": agrees(again)}
    if args.pictures:
        name = f"{file.parent.name}-{file.stem}"
        pictures = {"etendue": images, "mitsuba": theirs}
        for who, image in pictures.items():
            agreement.write_image(
                pathlib.Path(args.pictures) / f"{name}-{who}.exr", image.mean(axis=0)
            )
    return result


def line(result):
    if "error" in result:
        return f"ERROR    {result['error'][:110]}"
    return (
        f"{'agrees' if result['agrees'] else 'DIFFERS':8} ratio {result['ratio']:.4f} ±{result['ratio_error']:.4f}"
        f"  tiles failed {result['tiles_failed']:2}, largest difference"
        f" {100 * result['largest_tile_difference']:6.2f} % of the mean"
    )


def markdown_table(report):
    """Those that do not agree, for docs/agreement.md."""
    lines = ["| scene | ratio of means ± standard error | tiles that fail | after conversion |"]
    lines.append("| --- | --- | --- | --- |")
    for name, c in report["scenes"].items():
        if "error" in c:
            lines.append(f"| {name} | {c['error']} | | |")
        if c.get("agrees", True):
            continue
        again = c.get("converted")
        again = None if again and "error" in again else again
        lines.append(
            f"| {name} | {c['ratio']:.4f} ± {c['ratio_error']:.4f} | {c['tiles_failed']} | "
            + (f"{again['ratio']:.4f} ± {again['ratio_error']:.4f}, {again['tiles_failed']}" if again else "")
            + " |"
        )
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scenes", nargs="*", help="parts of the names of scenes, or files (default: all)")
    agreement.add_arguments(parser)
    parser.add_argument("--runs", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1, help="of the first run")
    parser.add_argument("--spp", type=int, default=1024, help="samples per pixel of each run of small images")
    parser.add_argument("--mitsuba-spp", type=int, default=128, help="the same of Mitsuba, which is slower")
    args, mitsuba, report = agreement.start(parser, "scenes", markdown_table)
    root = agreement.ROOT
    files = sorted([*root.glob("tests/scenes/formats/[gmp]*/*"), *root.glob("scenes/*.xml")])
    scenes = {f"{file.parent.name}/{file.stem}": file for file in files}
    if args.scenes:
        given = {n: pathlib.Path(n).resolve() for n in args.scenes if pathlib.Path(n).is_file()}
        parts = [n for n in args.scenes if n not in given]
        scenes = {n: f for n, f in scenes.items() if any(part in n for part in parts)} | given
    surprises = 0
    with tempfile.TemporaryDirectory() as temporary:
        temporary = pathlib.Path(temporary)
        ours = agreement.Etendue("path", args, temporary)
        for i, (name, file) in enumerate(scenes.items()):
            try:
                result = compare_scene(file, mitsuba, ours, temporary / str(i), args)
            except Exception as error:  # what one of the two cannot read
                result = {"error": str(error).strip().splitlines()[-1]}
            print(f"{name:38} {line(result)}  {DIFFERENT.get(name, '')}", flush=True)
            if "converted" in result:
                print(f"{'  converted':38} {line(result['converted'])}", flush=True)
            agreed = result.get("agrees") or result.get("converted", {}).get("agrees", False)
            surprises += agreed == (name in DIFFERENT)
            report["scenes"][name] = result
            args.json.write_text(json.dumps(report, indent=1) + "\n")
    sys.exit(1 if surprises else 0)


if __name__ == "__main__":
    main()
