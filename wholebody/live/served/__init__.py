"""The balanced robot for another program: controller and simulation beside it, targets in, observations out."""
