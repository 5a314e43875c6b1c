"""Policy, controller and MuJoCo in ten lines."""

from models.g1 import g1
from policy.scripted.library import reach
from wholebody.episode.run import run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.sim.plant import MujocoPlant

spec = g1()
policy, supervisor, plant = reach(0.45, 0.60), Supervisor(spec), MujocoPlant(spec)
result = run_episode(policy, supervisor, plant, duration=policy.duration)
print(f"fell: {result.fall is not None}, palm error at the end {1e3 * result.errors[-1].max():.2f} mm")
