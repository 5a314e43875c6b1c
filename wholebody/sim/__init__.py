"""The robot in MuJoCo: plant, scenes, sensors, falls, recordings and pictures.

Begin with `wholebody.sim.plant.MujocoPlant`; how a realistic robot differs is `wholebody.sim.robot_errors`.
"""
