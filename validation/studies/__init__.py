"""Studies that use the harness: what accuracy costs, what effects cost, the models."""
