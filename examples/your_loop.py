"""A policy drives your robot: sensor readings in, motor commands out. `docs/your_robots_loop.md` explains it.

``python examples/your_loop.py`` runs the loop on a stand-in for your robot, with MuJoCo behind it.
"""

from functools import partial
from time import monotonic, sleep

import numpy as np

from models import g1
from policy import Executor, ExecutorConfig, scripted_policy
from wholebody import JointCommand, MujocoPlant, Robot, StateEstimator, Status, Supervisor, ThreadPlanner, observe


def drive(robot, policy, seconds, task=""):
    """The loop. Yours: ``robot.now()``, ``robot.read()``, which waits for the next readings, ``robot.write()``."""
    spec = g1()
    estimator, supervisor = StateEstimator(spec), Supervisor(spec, planner=ThreadPlanner)
    executor = Executor(policy, clock=robot, config=ExecutorConfig(lead=supervisor.config.planning.lead))
    supervisor.reset(estimator.state(**robot.read()))
    executor.reset(task)
    said = None
    while robot.now() < seconds:
        state = estimator.state(**robot.read())
        chunk = executor.poll(partial(observe, spec, supervisor, state, task, now=robot.now()))
        answer = supervisor.take_refusal() if chunk is None else supervisor.accept(chunk, robot.now())
        if answer is not None and answer.status is Status.HOLD and answer.reason:
            executor.refused(answer.reason, answer.detail)
        c = supervisor.step(state, robot.now())
        robot.write(dict(zip(spec.joint_names, zip(c.q, c.dq, c.tau, c.kp, c.kd, strict=True), strict=True)))
        if (status := supervisor.status).reason != said:
            said = status.reason
            print(f"{robot.now():.3f} s: {status.status.value}, {status.detail or 'as given'}")
    executor.close()


class StandIn:
    """In place of your robot: joints by name, an IMU, a clock, 500 readings a second, motors with a position loop."""

    def __init__(self):
        spec = g1()
        self.plant, self.names, self.motors = MujocoPlant(spec), Robot(spec).joint_names, spec.joint_names
        self.state, self.command, self.begin = self.plant.reset(), None, monotonic()

    def now(self):
        """Seconds on the clock that the readings are stamped with."""
        return self.state.time

    def read(self):
        """The next readings, once they are there."""
        if self.command is not None:
            self.state = self.plant.step(self.command)
        sleep(max(0.0, self.begin + self.state.time - monotonic()))
        q, v = self.state.q, self.state.v
        joints, speeds = dict(zip(self.names, q[7:], strict=True)), dict(zip(self.names, v[6:], strict=True))
        torques, acc = (
            dict(zip(self.names, self.state.tau, strict=True)),
            self.plant.data.sensor("imu_accelerometer").data,
        )
        imu = {"quat_xyzw": q[3:7], "gyro": v[3:6], "acc": acc}
        return {"time": self.state.time, "joints": joints, "speeds": speeds, "torques": torques} | imu

    def write(self, motors):
        """Position [rad], speed [rad/s], torque [N m], stiffness and damping for each motor by name."""
        self.command = JointCommand(self.state.time, *np.array([motors[name] for name in self.motors]).T)


if __name__ == "__main__":
    drive(StandIn(), scripted_policy("wave", swings=1), seconds=4.0)
