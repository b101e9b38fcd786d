"""Run every engine on every scene, in parallel, resumable."""
