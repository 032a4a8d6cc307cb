"""One image by the processes of an MPI job, each with its own seed.

    pip install mpi4py
    mpirun -n 4 python -m mpi4py examples/mpi_cluster.py scenes/demo.xml upg+bdpt 64 demo.exr

`-m mpi4py` ends the job if one of the processes fails. Each of them uses all cores that it may run on.
"""

import sys

from mpi4py import MPI

import etendue as et

world = MPI.COMM_WORLD
file, integrator, spp, output = sys.argv[1:]
result = et.render(et.load(file).build(), integrator, spp=int(spp), seed=world.rank, progress=False)
parts = world.gather(result.partial())
if parts is not None:
    et.merge(parts).save(output)
