"""Check of the processor, before compiled code could end the process by an illegal instruction."""

import os
from pathlib import Path

# What -march=x86-64-v3 may use, by the names of /proc/cpuinfo.
NEEDED = ("avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe")


def check_cpu(cpuinfo: str = "/proc/cpuinfo") -> None:
    """Raises ImportError if the processor lacks instructions that the package needs."""
    if os.environ.get("ETENDUE_ANY_CPU"):
        return
    try:
        text = Path(cpuinfo).read_text()
    except OSError:
        return
    for line in text.splitlines():
        if line.startswith("flags"):
            flags = line.split()
            missing = [name for name in NEEDED if name not in flags]
            if missing:
                raise ImportError(
                    "etendue needs a processor with x86-64-v3 (AVX2, FMA), but this one lacks "
                    f"{', '.join(missing)}. Build it from source with "
                    "pip install . --config-settings=cmake.define.ETENDUE_ARCH=x86-64, and set ETENDUE_ANY_CPU=1"
                )
            return
