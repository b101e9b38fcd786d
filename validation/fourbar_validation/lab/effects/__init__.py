"""What each effect costs, and what an absent one leaves."""
