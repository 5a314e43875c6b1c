"""Settings of the robot, as LeRobot's command lines have them: ``--robot.NAME=VALUE``."""

from __future__ import annotations

from dataclasses import dataclass, field

from lerobot.robots import RobotConfig

LINKS = ("sim",)
"""What a robot can be reached by so far."""
CLOCKS = ("wall", "lockstep")
TASKS = (
    "none", "reach", "pick", "place", "lift", "lift_crate", "press", "hand_over", "pick_low", "shelf", "open_drawer",
    "wipe",
)  # fmt: skip
TOLD = ("lift", "lift_crate", "open_drawer")
"""Tasks whose actions always tell the forces that palms are to meet."""
RECORDS = ("requested", "executed")
DISTURB_MAX = 0.1
"""Largest standard deviation of a disturbance [m]; chosen: goals are 0.3 m from the stance."""


@dataclass(kw_only=True)
class WholebodyCameraConfig:
    """A camera of the robot, drawn from the scene once an observation; its name says which one it is."""

    width: int = 320
    """Width of its pictures [px]."""
    height: int = 240
    """Height of its pictures [px]."""


@RobotConfig.register_subclass("wholebody_g1")
@dataclass(kw_only=True)
class WholebodyG1Config(RobotConfig):
    """The balanced G1."""

    link: str = "sim"
    """What the robot is reached by: MuJoCo beside it."""
    clock: str = "wall"
    """Clock of the robot: the wall's, or in lockstep as much as LeRobot waits."""
    scene: str = "floor"
    """Around the robot: floor, table, ... or a MuJoCo file (.xml)."""
    cameras: dict[str, WholebodyCameraConfig] = field(default_factory=dict)
    """Cameras by name: head, left_wrist or right_wrist: ``"{head: {width: 96, height: 96}}"``."""
    task: str = "none"
    """What is to be done, which is shown among the observations: with reach each palm has a goal; the others move
    something, in a scene of their own."""
    forces: bool = False
    """Whether an action tells the forces that palms are to meet, in six numbers more; of lift, lift_crate and
    open_drawer it always does."""
    seed: int = 0
    """Seed of the task's goals."""
    gate: bool = False
    """Whether targets are judged before they are followed, and rejected where they cannot be done nearly so."""
    record: str = "requested"
    """Which actions are written into datasets: as requested, or as executed, which is measured a step later."""
    disturb: float = 0.0
    """Standard deviation of what leads both hands aside of what is asked of them, slowly [m], so that a recording shows
    how to come back from where a policy strays."""
    settings: str = ""
    """YAML file with changed settings of the controller."""
    report: str = ""
    """File for a summary of the run, written at its end, as JSON; also where this program was killed."""

    @property
    def tells_forces(self) -> bool:
        """Whether an action tells forces."""
        return self.forces or self.task in TOLD

    def __post_init__(self) -> None:
        if self.link in ("twin", "dds"):
            raise ValueError(f"--robot.link={self.link} is not built yet: the robot is reached by {', '.join(LINKS)}")
        for name, known in (("link", LINKS), ("clock", CLOCKS), ("task", TASKS), ("record", RECORDS)):
            if getattr(self, name) not in known:
                raise ValueError(f"--robot.{name}={getattr(self, name)} is unknown; there are {', '.join(known)}")
        if not 0.0 <= self.disturb <= DISTURB_MAX:
            raise ValueError(f"--robot.disturb={self.disturb} is out of bounds: from 0 to {DISTURB_MAX} m")
        if self.task not in TASKS[:2] and self.clock != "lockstep":
            raise ValueError(f"--robot.task={self.task} needs --robot.clock=lockstep, in which things are put back")
