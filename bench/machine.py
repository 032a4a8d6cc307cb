"""What a report says about the machine, the program and the moment of a measurement."""

import os
import pathlib
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUSY = 0.5  # Load from which on times vary.


def commit():
    """Of this tree; of the tree before the first measurement where several write into it, as scripts/results does."""
    describe = ["git", "-C", str(ROOT), "describe", "--always", "--dirty"]
    return os.environ.get("ETENDUE_COMMIT") or subprocess.run(describe, capture_output=True, text=True).stdout.strip() or "unknown"


def described(program):
    """To be called before the measurement, which itself is a load."""
    names = [line.split(":", 1)[1].strip() for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines()
             if line.startswith("model name")]
    version = subprocess.run([str(program), "--version"], capture_output=True, text=True, check=True).stdout.strip()
    return {"date": time.strftime("%Y-%m-%d", time.gmtime()), "commit": commit(), "program": version,
            "processor": names[0] if names else "unknown", "cores": len(os.sched_getaffinity(0)),
            "load": round(os.getloadavg()[0], 2)}


def warn_if_busy(machine, who):
    if machine["load"] > BUSY:
        print(f"{who}: the machine is busy (load {machine['load']:.1f}), so results will vary", file=sys.stderr)


def sentence(machine):
    """For the manual."""
    load = f", under a load of {machine['load']:.1f}" if machine["load"] > BUSY else ""
    cores = "one core" if machine["cores"] == 1 else f"{machine['cores']} cores"
    return f"{machine['date']}, commit {machine['commit']}, {cores} ({machine['processor']}){load}"
