"""The robot in MuJoCo: plant, scenes, sensors, falls, recordings and pictures."""
