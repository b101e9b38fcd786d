"""The cheapest settings of MuJoCo that keep torque and pin forces within a required error."""
