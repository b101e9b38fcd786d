"""The run: every witness asked about every scene, in parallel, resumable."""
