"""A Slurm cluster of this machine alone."""

import getpass
import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "scontrol", "sinfo", "squeue", "scancel")

CONF = """
ClusterName=one
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser={user}
SlurmdUser={user}
AuthInfo=socket={folder}/munge.socket,cred_expire=5
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
MpiDefault=none
KillWait=5
ReturnToService=2
SlurmdParameters=config_overrides
NodeName={host} NodeAddr=127.0.0.1 CPUs=2
PartitionName=all Nodes=ALL Default=YES State=UP
"""


def free_ports(count: int) -> list[int]:
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [s.getsockname()[1] for s in sockets]
    for s in sockets:
        s.close()
    return ports


def wait_until(done: Callable[[], object], seconds: float, what: str) -> None:
    until = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < until, what
        time.sleep(0.1)


def output_of(*words: str) -> str:
    return subprocess.run(words, capture_output=True, text=True, check=False).stdout.strip()


def wait_for_jobs() -> None:
    wait_until(lambda: output_of("squeue", "--noheader") == "", 240, "the jobs do not end")


@contextmanager
def running(programs: dict[str, str]) -> Iterator[Path]:
    """Daemons that belong to the caller, and their folder. `programs`: where PROGRAMS are. SLURM_CONF in the environment names the
    cluster meanwhile."""
    host = socket.gethostname().split(".")[0]
    daemons: list[subprocess.Popen[bytes]] = []
    # Names of sockets are short.
    with tempfile.TemporaryDirectory(prefix="slurm-") as name:
        folder = Path(name)
        key, conf = folder / "munge.key", folder / "slurm.conf"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        user = getpass.getuser()
        conf.write_text(CONF.format(host=host, ports=free_ports(2), user=user, folder=folder))
        for part in ("state", "spool"):
            (folder / part).mkdir()
        before = os.environ.get("SLURM_CONF")
        os.environ["SLURM_CONF"] = str(conf)
        of_munge = [f"--{what}={folder}/munge.{what[:-5]}" for what in ("key-file", "pid-file", "log-file", "seed-file")]
        commands = (
            [programs["munged"], "--foreground", "--force", f"--socket={folder}/munge.socket", *of_munge],
            [programs["slurmctld"], "-D"],
            [programs["slurmd"], "-D"],
        )
        with (folder / "log").open("wb") as log:
            try:
                for words in commands:
                    daemons.append(subprocess.Popen(words, stdout=log, stderr=log))
                    if words[0] == programs["munged"]:
                        wait_until((folder / "munge.socket").exists, 30, "munged does not start")
                wait_until(lambda: output_of("sinfo", "--noheader", "--format=%t") == "idle", 60, "Slurm does not start")
                yield folder
            finally:
                try:
                    output_of("scancel", "--user", user)
                    wait_for_jobs()
                finally:
                    print((folder / "log").read_text())
                    for daemon in reversed(daemons):
                        daemon.terminate()
                        daemon.wait()
                    if before is None:
                        del os.environ["SLURM_CONF"]
                    else:
                        os.environ["SLURM_CONF"] = before
