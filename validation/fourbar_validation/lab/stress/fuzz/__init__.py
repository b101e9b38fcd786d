"""Random and mutated scenes through everything."""
