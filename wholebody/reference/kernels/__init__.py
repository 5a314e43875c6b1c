"""Hand paths and smoother at one instant, compiled."""
