"""Policy, controller and MuJoCo in ten lines."""

from models import g1
from policy import scripted_policy
from wholebody import MujocoPlant, Supervisor, run_episode

spec = g1()
policy = scripted_policy("reach", x=0.45, z=0.60)
supervisor, plant = Supervisor(spec), MujocoPlant(spec)
result = run_episode(policy, supervisor, plant, duration=policy.duration)
print(f"fell: {result.fall is not None}, palm error at the end {1e3 * result.errors[-1].max():.2f} mm")
