"""Whole-body control of the Unitree G1: from an action chunk to joint commands that keep it standing.

The public names, each imported when it is first used: importing the package loads neither Pinocchio nor MuJoCo.
"""

from importlib import import_module

_HOME = {
    "REALISTIC": "sim.sensors",
    "REALISTIC_READINGS": "sim.sensors",
    "REALISTIC_ROBOT": "sim.robot_errors",
    "BodyReference": "control.reference_packet",
    "Checker": "verdict.check",
    "ChunkGate": "verdict.chunk_gate",
    "ConfigError": "errors",
    "ControlLoop": "live.loop",
    "ControllerConfig": "config",
    "EpisodeConfig": "episode.run",
    "EpisodeResult": "episode.run",
    "ExecutedActions": "episode.executed",
    "FastChecker": "verdict.fast",
    "Guide": "guide.guide",
    "InputError": "errors",
    "JointCommand": "types",
    "MujocoPlant": "sim.plant",
    "Outcome": "verdict.trial",
    "PalmReference": "control.reference_packet",
    "PlannerProcess": "execution.planner_process",
    "PostureLimit": "planning.still_postures",
    "PosturePath": "planning.posture_path",
    "PostureSolver": "planning.posture",
    "Ranking": "verdict.given.many",
    "ReachabilityMap": "planning.reachability.reach_map",
    "Readings": "estimation.readings",
    "RealisticPlant": "sim.robot_errors",
    "Reason": "types",
    "Robot": "robot.state",
    "RobotConfig": "config",
    "RobotErrors": "sim.robot_errors",
    "RobotLink": "live.robot_link",
    "RobotProcess": "live.robot_process",
    "RobotState": "types",
    "SensorConfig": "sim.sensors",
    "Sensors": "sim.sensors",
    "Solution": "planning.posture",
    "StandingPlace": "planning.reachability.standing_place",
    "StateEstimator": "estimation.state_estimator",
    "Status": "types",
    "StatusReport": "types",
    "Supervisor": "execution.supervisor",
    "ThreadPlanner": "execution.background_planner",
    "Verdict": "verdict.verdict",
    "WalkedTo": "episode.walk_to",
    "WholeBodyController": "control.controller",
    "WholebodyError": "errors",
    "World": "live.robot_process",
    "as_given": "verdict.trial",
    "describe": "config.description",
    "dump_config": "config.file",
    "guided": "guide.denoising",
    "judge": "verdict.given.own_numbers",
    "judge_many": "verdict.given.many",
    "load_config": "config.file",
    "make_controller": "backends.registry",
    "path_to": "planning.posture",
    "observe": "episode.run",
    "record_executed": "episode.executed",
    "repair": "verdict.given.own_numbers",
    "reachability": "planning.reachability.reach_map",
    "run_episode": "episode.run",
    "solve": "planning.posture",
    "stand_for": "planning.reachability.standing_place",
    "walk_to": "episode.walk_to",
    "warm_up": "episode.warm_up",
}
"""Public name and the module that it is in."""

__all__ = list(_HOME)


def __getattr__(name: str) -> object:
    """A public name, from its module.

    Raises:
        AttributeError: If there is no such name.
    """
    if name not in _HOME:
        raise AttributeError(f"module 'wholebody' has no attribute '{name}'; it offers {', '.join(_HOME)}")
    return getattr(import_module(f"wholebody.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
