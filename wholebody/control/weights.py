"""What the program weighs, as data: standing, walking and recovery ask for the same tasks with other weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wholebody.config import ControllerConfig
from wholebody.contacts.foot import FootContact
from wholebody.jit.packed import Packed
from wholebody.tasks.body_tasks import BodyTasks


@dataclass(frozen=True, kw_only=True)
class Weights:
    """Weights of the tasks of a body; hands and fingers have other settings.

    Attributes:
        com: Centre of mass per world axis [1/(m/s^2)^2].
        momentum: [1/(N m)^2]
        pelvis, torso: Orientations [1/(rad/s^2)^2].
        height: Of the pelvis [1/(m/s^2)^2].
        legs: Joints of the legs [1/(rad/s^2)^2].
        upper: Joints of waist and arms [1/(rad/s^2)^2].
        flat: Orientation of a foot that is up [1/(rad/s^2)^2].
        leans: How much further pelvis and torso may turn from where they are to be than the configuration says [rad].
        landing: With which the motion of a foot that stands is damped [1/s].
        leak: Time constants with which the desired state forgets its difference from the measured one, of legs and of
            other joints [s].
        balance: Whether the capture point is kept inside the support; not where a step is the answer.
    """

    com: tuple[float, float, float]
    momentum: float
    pelvis: float
    torso: float
    height: float
    legs: float
    upper: float
    flat: float
    leans: float
    landing: float
    leak: tuple[float, float]
    balance: bool

    @classmethod
    def standing(cls, config: ControllerConfig) -> Weights:
        """Weights of a configuration: both feet stay."""
        body = config.body
        return cls(
            com=body.com_weight,
            momentum=body.momentum_weight,
            pelvis=body.pelvis_weight,
            torso=body.torso_weight,
            height=body.height_weight,
            legs=body.posture_weight,
            upper=body.posture_weight,
            flat=config.hand.orientation_weight,
            leans=0.0,
            landing=config.foot_kd,
            leak=(config.leak, config.leak),
            balance=True,
        )

    def apply(self, tasks: BodyTasks, feet: Sequence[FootContact], legs: np.ndarray, tick: Packed | None) -> None:
        """Weigh tasks so from now on.

        Args:
            tasks: Those of a controller.
            feet: Its contacts.
            legs: Which joints are of the legs, Pinocchio order, shape (n_joints,).
            tick: Memory of its compiled program, or None.
        """
        tasks.com.weight[:], tasks.momentum.weight[:] = self.com, self.momentum
        tasks.pelvis.weight[:], tasks.torso.weight[:], tasks.height.weight[:] = self.pelvis, self.torso, self.height
        body = ~np.isin(np.arange(len(legs)), tasks.fingers)
        tasks.posture.weight[body] = np.where(legs, self.legs, self.upper)[body]
        for up in tasks.feet:
            up.weight[3:] = self.flat
        for foot in feet:
            foot.kd = self.landing
        if tick is not None:
            tick.foot_kd = self.landing
            tick.com_weight[:], tick.momentum_weight = self.com, self.momentum
            tick.pelvis_gain[3], tick.torso_gain[3], tick.height_gain[3] = self.pelvis, self.torso, self.height
            tick.posture_weight[:], tick.foot_weight[1] = tasks.posture.weight, self.flat


WALKING = Weights(
    com=(3000.0, 3000.0, 500.0),
    momentum=0.1,
    pelvis=10.0,
    torso=10.0,
    height=0.0,
    legs=0.02,
    upper=0.1,
    flat=10.0,
    leans=0.0,
    landing=100.0,
    leak=(0.03, 0.1),
    balance=False,
)
"""One foot carries in turn [units as in `Weights`]; chosen: the height of the centre of mass in place of the pelvis',
and legs that follow their feet. With 1000 for the centre of mass the reaction of the leg that swings took realistic
robots off their walk at 0.4 m/s. A leak of 0.1 s in place of 0.3 halves what the palms are off while stepping; 0.03 s
of the legs, measured: in 0.1 s their loops took 3 of the 7 N m with which an ankle presses on the edge of its sole,
and where arms have 0.03 s too, palms of realistic robots are 4 mm off in place of 2. A foot in the air that is kept
flat with 100 has its ankle at its end beside a slope of 3 degrees, and 4 of 15 realistic robots fell or stepped on."""
RECOVERING = replace(
    WALKING, com=(5000.0, 5000.0, 500.0), momentum=0.002, pelvis=2.0, torso=2.0, flat=1.0, leans=0.2, leak=(0.1, 0.1)
)
"""A step that catches the robot [units as in `Weights`]; chosen: the centre of mass above trunk and momentum, since the
reaction of a leg that swings fast is as large as what a sole can give. Measured: where the trunk was at its bounds, and
the ankle of a foot kept flat at its end, 11 of 15 crouching robots that were pushed back by 13 to 16 N s fell, with
these 3."""
