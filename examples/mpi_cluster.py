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
# One by one: mpi4py before version 4 gathers at most 2 GiB, and 17 images of 1920 x 1080 pixels have more.
if world.rank > 0:
    world.send(result.partial(), dest=0)
else:
    total = et.merge([result.partial(), *(world.recv(source=i) for i in range(1, world.size))])
    print(total)
    total.save(output)
