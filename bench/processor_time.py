"""Renderings that are limited by processor time, which other programs on the machine hardly change, instead of elapsed time."""

import os
import subprocess
import tempfile


def measured(command):
    """Runs a program; its exit status, output and messages, and the seconds that its threads were computing."""
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as errors:
        child = subprocess.Popen(list(map(str, command)), stdout=output, stderr=errors, text=True)
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        errors.seek(0)
        done = subprocess.CompletedProcess(command, child.returncode, output.read(), errors.read())
        return done, usage.ru_utime + usage.ru_stime


def samples_in(seconds, statistics, cpu, wall, before=0):
    """The number of samples per pixel that take so much processor time on one thread, from another rendering by one thread: its
    statistics (--stats) and its processor and elapsed seconds. `before` seconds, as for reading the scene, do not count; what the
    method does before its first sample does. The first pass contains that, so one pass alone says too little of a sample."""
    passes = statistics["pass_seconds"]
    each = cpu / wall * (sum(passes[1:]) / (len(passes) - 1) if len(passes) > 1 else passes[0])
    start = max(0, cpu - before - each * len(passes))
    return max(1, round((seconds - start) / each))
