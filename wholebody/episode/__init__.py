"""The closed loop in stepped simulation, and what is measured in it."""
