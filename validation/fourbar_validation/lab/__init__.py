"""Studies of the harness and of simulators; nothing that judges needs them."""
