#!/usr/bin/env python3
"""Renders every scene of the shared folder with five methods and compares their images.

Each method makes several images that differ in their seed. Compared are the means of the images and of
their tiles, by Welch's t-test (see agreement.py), with one method and with the scene's reference image.
Every image is kept with a record of its run, so that an interrupted run can be continued and seeds can be
added. Contact sheets show the methods and the reference side by side. The tables of
docs/tested-scenes.md are printed at the end.
"""

import argparse
import json
import os
import pathlib
import re
import subprocess
import sys

import agreement

METHODS = ("path", "bdpt", "vcm", "upg+bdpt", "pcbpt")
# Method with which the others are compared, where bdpt has only fireflies of what is important.
BASE = {"water-caustic-pbrt4": "upg+bdpt"}
# Radiance at which the images and the reference are clamped before their means are compared: a lamp that is
# smaller than a pixel has the mean of the reference.
CLAMP = {"water-caustic-pbrt4": 3}
SUFFIXES = (".xml", ".pbrt", ".gltf", ".glb")


class Scene:
    def __init__(self, file):
        self.file = file
        folder = file.parent
        self.name = folder.name
        if sum(is_scene(other) for other in folder.iterdir()) > 1:
            self.name += "-" + file.stem
        references = [*folder.glob("reference/*.exr"), *folder.glob("ref1.pfm")]
        self.reference = references[0] if references else None
        self.base = BASE.get(folder.name, "bdpt")
        self.clamp = CLAMP.get(folder.name)


def is_scene(file):
    """Files that a pbrt scene includes have no camera."""
    if file.suffix == ".pbrt":
        return re.search(r"^\s*Camera\b", file.read_text(), re.M) is not None
    return file.suffix in SUFFIXES


def find_scenes(root, names):
    scenes = [Scene(file) for file in sorted(root.glob("*/*")) if is_scene(file)]
    return [s for s in scenes if not names or any(name in s.name for name in names)]


class Runs:
    """Images and records of one scene, in a folder of its own."""

    def __init__(self, scene, args):
        self.scene, self.args = scene, args
        self.folder = args.out / scene.name
        self.folder.mkdir(parents=True, exist_ok=True)
        self.options = self.needed_options()

    def needed_options(self):
        """--lenient if the scene cannot be loaded without; and the size of the image."""
        file = self.folder / "info.json"
        if not file.exists():
            for options in ([], ["--lenient"]):
                command = [self.args.etendue, "info", self.scene.file, "--json", *options]
                done = subprocess.run(command, capture_output=True, text=True)
                if done.returncode == 0:
                    break
            else:
                raise RuntimeError(done.stderr.strip())
            file.write_text(json.dumps({"options": options, "info": json.loads(done.stdout)}))
        loaded = json.loads(file.read_text())
        width, height = loaded["info"]["width"], loaded["info"]["height"]
        self.lenient = bool(loaded["options"])
        return [*loaded["options"], "--resolution", f"{self.args.width}x{round(height * self.args.width / width)}"]

    def file(self, method, seed, suffix):
        return self.folder / f"{method}-{seed}{suffix}"

    def render(self, method, seed):
        """Makes the image, unless it is there."""
        image, record = self.file(method, seed, ".pfm"), self.file(method, seed, ".json")
        if record.exists():
            return
        statistics = self.folder / "statistics.json"
        command = [self.args.etendue, "render", self.scene.file, "-i", method, "--spp", str(self.args.spp), "-o", image]
        command += ["--seed", str(seed), "--threads", str(self.args.threads), "--stats", statistics, "--quiet"]
        process = subprocess.Popen([*command, *self.options], stderr=subprocess.PIPE, text=True)
        errors = process.stderr.read()
        _, status, usage = os.wait4(process.pid, 0)
        done = {"exit": os.waitstatus_to_exitcode(status), "cpu_seconds": usage.ru_utime + usage.ru_stime,
                "largest_memory_mib": usage.ru_maxrss / 1024, "stderr": errors.splitlines()}
        if done["exit"] == 0:
            stats = json.loads(statistics.read_text())
            keys = ("mean_luminance", "mean_luminance_standard_error", "warnings", "rejected_contributions")
            done |= {key: stats[key] for key in keys} | {"integrator": stats["integrator"]}
        record.write_text(json.dumps(done, indent=1) + "\n")

    def images(self, method):
        import numpy as np

        files = [self.file(method, seed, ".pfm") for seed in range(self.args.seeds)]
        return np.array([agreement.read_image(file) for file in files if file.exists()])

    def records(self, method):
        files = [self.file(method, seed, ".json") for seed in range(self.args.seeds)]
        return [json.loads(file.read_text()) for file in files if file.exists()]


def resized(image, width, height):
    """Means over the area of each pixel."""
    import numpy as np
    from PIL import Image

    channels = [Image.fromarray(image[..., c].astype(np.float32)) for c in range(3)]
    return np.stack([np.array(c.resize((width, height), Image.Resampling.BOX)) for c in channels], axis=-1)


def reference_image(scene):
    import numpy as np

    return np.nan_to_num(agreement.read_image(scene.reference), posinf=0) if scene.reference else None


def contact_sheet(runs):
    """The methods' first images and the reference, at one exposure."""
    import numpy as np
    from PIL import Image, ImageDraw

    pictures = {method: runs.images(method)[0] for method in METHODS if runs.file(method, 0, ".pfm").exists()}
    height, width, _ = next(iter(pictures.values())).shape
    reference = reference_image(runs.scene)
    if reference is not None:
        pictures["reference"] = resized(reference, width, height)
    middle = np.median([np.median(p[p > 0]) if (p > 0).any() else 1 for p in pictures.values()])
    sheet = Image.new("RGB", (3 * (2 * width + 4), ((len(pictures) + 2) // 3) * (2 * height + 18)))
    draw = ImageDraw.Draw(sheet)
    for i, (name, picture) in enumerate(pictures.items()):
        scaled = np.clip(picture, 0, None) * 0.5 / middle
        grey = (scaled / (1 + scaled)) ** (1 / 2.2)
        tile = Image.fromarray((255 * grey).astype(np.uint8)).resize((2 * width, 2 * height), Image.Resampling.NEAREST)
        x, y = (i % 3) * (2 * width + 4), (i // 3) * (2 * height + 18)
        draw.text((x + 4, y + 3), f"{runs.scene.name}: {name}")
        sheet.paste(tile, (x, y + 18))
    sheet.save(runs.args.out / f"{runs.scene.name}.png")


def evaluate(runs):
    """Means, their standard errors, and the comparisons of all methods of a scene."""
    import numpy as np
    from scipy import stats

    scene = runs.scene
    images = {method: runs.images(method) for method in METHODS}
    reference = reference_image(scene)
    reference_mean = None
    if reference is not None:
        reference = reference if scene.clamp is None else np.minimum(reference, scene.clamp)
        reference_mean = reference.mean()
    result = {"lenient": runs.lenient, "reference": reference_mean, "clamp": scene.clamp, "methods": {}}
    for method in METHODS:
        records = runs.records(method)
        value = {"runs": len(records), "exits": sorted({r["exit"] for r in records}),
                 "cpu_seconds": float(np.median([r["cpu_seconds"] for r in records])),
                 "largest_memory_mib": max(r["largest_memory_mib"] for r in records),
                 "warnings": sorted({w for r in records for w in r.get("warnings", [])}),
                 "rejected_contributions": sum(r.get("rejected_contributions", 0) for r in records)}
        if len(images[method]) > 1:
            mean, error = agreement.mean_and_error(images[method])
            value |= {"mean": mean, "error": error, "not_finite": int((~np.isfinite(images[method])).sum()),
                      "negative": int((images[method] < 0).sum())}
            if reference is not None:
                clamped = images[method] if scene.clamp is None else np.minimum(images[method], scene.clamp)
                means = clamped.mean(axis=(1, 2, 3)) / reference_mean
                value["of_reference"] = [float(means.mean()), float(stats.sem(means))]
            if method != scene.base:
                value["against"] = agreement.compare(images[method], images[scene.base])
        result["methods"][method] = value
    return result


def tables(report):
    def row(*cells):
        return "| " + " | ".join(cells) + " |"

    def ratio(value, base):
        if "against" not in value:
            return "1"
        c = value["against"]
        failed = f", {c['tiles_failed']}" if c["tiles_failed"] else ""
        return f"{c['ratio']:.3f} ± {c['ratio_error']:.3f}{failed}"

    lines = [row("scene", "mean of `bdpt`", *(f"`{m}`" for m in METHODS if m != "bdpt"), "CPU s", "MiB"),
             row(*["---"] * (len(METHODS) + 3))]
    for name, scene in report["scenes"].items():
        methods = scene["methods"]
        base = methods["bdpt"]
        mean = f"{base['mean']:.4g} ± {100 * base['error'] / base['mean']:.1f} %"
        if "against" in base:
            mean += f" ({ratio(base, None)})"
        seconds = ", ".join(f"{methods[m]['cpu_seconds']:.0f}" for m in METHODS)
        memory = f"{max(v['largest_memory_mib'] for v in methods.values()):.0f}"
        lines.append(row(name, mean, *(ratio(methods[m], base) for m in METHODS if m != "bdpt"), seconds, memory))
    lines += ["", row("scene", *(f"`{m}` / reference" for m in METHODS)), row(*["---"] * (len(METHODS) + 1))]
    for name, scene in report["scenes"].items():
        if scene["reference"] is not None:
            values = [scene["methods"][m]["of_reference"] for m in METHODS]
            lines.append(row(name, *(f"{mean:.3f} ± {error:.3f}" for mean, error in values)))
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="only scenes whose name contains one of these")
    parser.add_argument("--etendue", default=str(agreement.ROOT / "build/release/etendue"))
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--width", type=int, default=240)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--seeds", type=int, default=4, help="images of each method (default 4)")
    parser.add_argument("--out", type=pathlib.Path, default=agreement.ROOT / "out/tested-scenes")
    parser.add_argument("--render-only", action="store_true", help="make images and records, but no tables")
    parser.add_argument("--evaluate-only", action="store_true", help="evaluate the images that are there")
    parser.add_argument("--json", type=pathlib.Path, help="write all figures to this file")
    args = parser.parse_args()
    root = pathlib.Path(os.environ.get("ETENDUE_SCENES", agreement.ROOT.parent / "shared" / "scenes"))
    if not root.is_dir():
        print(f"tested-scenes: skipped: there is no folder {root}; ETENDUE_SCENES names it")
        return
    if not args.render_only:
        agreement.ensure_packages()
    runs = [Runs(scene, args) for scene in find_scenes(root, args.names)]
    if not args.evaluate_only:
        for seed in range(args.seeds):
            for run in runs:
                for method in METHODS:
                    run.render(method, seed)
                print(f"{run.scene.name}: seed {seed}", file=sys.stderr, flush=True)
    if args.render_only:
        return
    report = {"width": args.width, "spp": args.spp, "scenes": {}}
    for run in runs:
        contact_sheet(run)
        report["scenes"][run.scene.name] = evaluate(run)
    if args.json:
        args.json.write_text(json.dumps(report, indent=1) + "\n")
    print(tables(report))


if __name__ == "__main__":
    main()
