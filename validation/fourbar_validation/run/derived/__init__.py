"""Judge what is derived from `solve`, through its public calls and by other means."""
