"""What each effect costs in each engine."""
