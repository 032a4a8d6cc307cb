#!/usr/bin/env bash
#SBATCH --array=0-7
#SBATCH --cpus-per-task=8
#SBATCH --time=1:00:00
#SBATCH --signal=B:USR1@120
#SBATCH --requeue
#SBATCH --open-mode=append
# One image by eight tasks, each with its own seed. A task that reaches its time, or whose machine fails, is queued again and
# goes on.
#     SCENE=scenes/demo.xml METHOD=upg+bdpt SPP=128 sbatch examples/slurm_array.sh
#     etendue merge task-*.etd -o image.exr
# Without Slurm, on one machine:
#     seq 0 7 | SCENE=scenes/demo.xml METHOD=upg+bdpt SPP=128 SLURM_CPUS_PER_TASK=$(($(nproc) / 2)) \
#         xargs -P 2 -I N env SLURM_ARRAY_TASK_ID=N bash examples/slurm_array.sh
set -euo pipefail
task=task-$SLURM_ARRAY_TASK_ID

# Two minutes before the end of its time (--signal), the rendering is stopped, which leaves a checkpoint. It may have ended.
is_late=false
trap 'is_late=true; kill -TERM $! 2>/dev/null || :' USR1
# Slurm sends these to the rendering as well, which then ends by itself.
trap : TERM INT HUP

"${ETENDUE:-etendue}" render "$SCENE" -i "$METHOD" --spp "$SPP" --seed "$SLURM_ARRAY_TASK_ID" \
    --threads "${SLURM_CPUS_PER_TASK:-0}" --grace "${GRACE:-20}" \
    --checkpoint "$task.etd" --resume auto -o "$task.exr" --quiet &
# A signal ends `wait`, but not the rendering.
while kill -0 $! 2>/dev/null; do wait $! || :; done
status=0
wait $! || status=$?
if $is_late && ((status == 0)); then scontrol requeue "$SLURM_JOB_ID"; fi
exit "$status"
