"""Contain, in a wheel, the scenes of models/, which a checkout has at its top."""
