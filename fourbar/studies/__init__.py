"""Studies: one scene, many linkages; what its quantities depend on."""
