"""The run: every witness on every scene, in parallel, resumable."""
