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


def samples_in(seconds, seconds_of):
    """The number of samples per pixel in that time, where seconds_of(samples) renders and tells how long it took. Short renderings
    tell what a sample takes, and what the method does before the first one."""
    first, samples = seconds_of(1), 1
    growth = 0.0  # of the time by the samples after the first one
    while growth < 0.1 * seconds and samples < 4096:
        samples *= 2 if growth > 0.03 * seconds else 4
        growth = seconds_of(samples) - first
        if first + growth > seconds:
            break
    # Where the growth is that of noise, the last number is near enough.
    each = max(growth, 0.02 * first, 1e-3 * seconds) / (samples - 1)
    return max(1, round(samples + (seconds - first - growth) / each))
