"""The cheapest settings of MuJoCo that keep an answer within a required error."""
