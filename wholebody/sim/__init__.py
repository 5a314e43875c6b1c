"""The robot in MuJoCo: plant, fall detection and tracking metrics."""
