"""Terms and steps of the trajectory optimiser, compiled."""
