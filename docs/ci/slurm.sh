#!/bin/sh
#SBATCH --job-name=four-bar
#SBATCH --array=1-50
#SBATCH --cpus-per-task=2
#SBATCH --mem=1G
#SBATCH --time=04:00:00
# Example for Slurm, in a folder that all machines see: sbatch slurm.sh [options of run ...]. Each task judges one part.
# One that was killed goes on where it ended: sbatch --array=7 --export=ALL,PARTS=50 slurm.sh [the same options ...].
part="$SLURM_ARRAY_TASK_ID/${PARTS:-$SLURM_ARRAY_TASK_COUNT}"
fourbar-validation run --workers "$SLURM_CPUS_PER_TASK" --part "$part" --out "parts/$SLURM_ARRAY_TASK_ID" "$@"
