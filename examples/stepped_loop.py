"""A policy drives a simulator that is stepped: time is the simulator's. `docs/your_robots_loop.md` explains it."""

from functools import partial

from models import g1
from policy import scripted_policy, simulated_executor
from wholebody import MujocoPlant, Supervisor, observe

spec = g1()
plant, supervisor = MujocoPlant(spec), Supervisor(spec)
executor = simulated_executor(scripted_policy("wave", swings=1), latency=0.1)  # seconds; None: as long as it takes
state = plant.reset()
supervisor.reset(state)
executor.reset("wave")
while state.time < 4.0:
    executor.clock.set(state.time)
    chunk = executor.poll(partial(observe, spec, supervisor, state))
    answer = supervisor.take_refusal() if chunk is None else supervisor.accept(chunk, state.time)
    if answer is not None and answer.reason:
        executor.refused(answer.reason, answer.detail)
    state = plant.step(supervisor.step(state, state.time))
print(f"{executor.report.summary()}; pelvis at {state.q[2]:.2f} m")
