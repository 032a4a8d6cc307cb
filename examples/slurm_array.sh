#!/usr/bin/env bash
#SBATCH --array=0-7
#SBATCH --cpus-per-task=8
#SBATCH --time=1:00:00
#SBATCH --signal=TERM@60
#SBATCH --requeue
# One image by eight tasks, each with its own seed. A task that is killed, or reaches its time, goes on when it is queued
# again.
#     SCENE=scenes/demo.xml METHOD=upg+bdpt SPP=128 sbatch slurm_array.sh
#     etendue merge task-*.etd -o image.exr
# Without Slurm, on one machine:
#     seq 0 7 | SCENE=scenes/demo.xml METHOD=upg+bdpt SPP=128 xargs -P 2 -I N env SLURM_ARRAY_TASK_ID=N bash slurm_array.sh
set -euo pipefail
task=task-$SLURM_ARRAY_TASK_ID
exec "${ETENDUE:-etendue}" render "$SCENE" -i "$METHOD" --spp "$SPP" --seed "$SLURM_ARRAY_TASK_ID" \
    --threads "${SLURM_CPUS_PER_TASK:-0}" --checkpoint "$task.etd" --resume auto -o "$task.exr" --quiet
