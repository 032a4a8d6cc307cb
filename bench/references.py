"""Reference images that are kept for later measurements, by a fingerprint of all that makes them."""

import hashlib
import json
import pathlib
import re
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent
FIRST_SEED = 10**6  # Of no measured image.


def hash_of_scene(file):
    """Contents of the scene, and of the meshes that it names if it is one of the project's, and otherwise of all files in its folder."""
    own = file.parent == ROOT / "scenes"
    meshes = re.findall(r'name="filename" value="(meshes/[^"]+)"', file.read_text()) if own else []
    files = [file, *(file.parent / mesh for mesh in meshes)] if own else sorted(f for f in file.parent.rglob("*") if f.is_file() and not f.name.startswith("ref"))
    digest = hashlib.sha256()
    for each in files:
        digest.update(f"{each.relative_to(file.parent)}\n{each.stat().st_size}\n".encode())
        with open(each, "rb") as content:
            while block := content.read(1 << 20):
                digest.update(block)
    return digest.hexdigest()


def call(program, *arguments):
    done = subprocess.run([str(program), *map(str, arguments)], capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"etendue {' '.join(map(str, arguments))}: {done.stderr.strip()}")
    return done.stdout


def references(program, scene, folder, *, method, seconds, resolution, threads):
    """Two independent images (.pfm) of a scene file, which are rendered where the folder does not have them yet. A method whose
    table of parameters has changed renders them anew."""
    table = call(program, "list", "integrator", method.split(":")[0], "--markdown")
    settings = {"scene": hash_of_scene(scene), "method": method, "table": hashlib.sha256(table.encode()).hexdigest(),
                "seconds": seconds, "resolution": resolution, "threads": threads}
    key = hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for k in range(2):
        file = folder / f"{scene.stem}-{key}-{k}.pfm"
        if not file.exists():
            part, stats = folder / f"part-{file.name}", folder / f"part-{file.stem}.json"
            call(program, "render", scene, "-i", method, "-o", part, "--time", seconds, "--seed", FIRST_SEED + k,
                 "--resolution", resolution, "--threads", threads, "--stats", stats, "--quiet")
            file.with_suffix(".json").write_text(json.dumps({**settings, "stats": json.loads(stats.read_text())}, indent=1) + "\n")
            stats.unlink()
            part.rename(file)
        files.append(file)
    return files
