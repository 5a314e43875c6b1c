"""Room for all limbs: the body of a robot with as many joints as the optimiser has, the real ones switched on.

Robots differ in the joints of waist and arms: a G1 has 29, 27 or 23 in its body, and its waist can be locked. The
optimiser has room for `ROOM`. Where a robot has fewer, joints without mass and without a body take the other places;
they stay at zero, and nothing depends on them.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from models.spec import RobotSpec
from wholebody.errors import InputError
from wholebody.trajopt.layout import N_BODY, N_JOINTS, WAIST

ARM = (N_JOINTS - 12 - WAIST) // 2
"""Most joints of an arm, derived from `N_JOINTS`: two legs of six and the waist are the others."""
ROOM = {"left_leg": 6, "right_leg": 6, "waist": WAIST, "left_arm": ARM, "right_arm": ARM}
"""Most joints of each limb, in the order of the optimiser; of a leg there must be so many."""
SPARE = "spare"


def with_room(spec: RobotSpec, model: pin.Model) -> pin.Model:
    """The body of a robot, without fingers, with joints in all places of `ROOM`; itself where it has them all.

    Args:
        spec: The robot.
        model: Pinocchio's model of the body; legs come first, as in `ROOM`.

    Raises:
        InputError: If a limb has more joints than there is room for, a leg fewer, or the order is another.
    """
    order = _order(spec, model)
    if order == list(model.names)[2:]:
        return model
    room, place = pin.Model(), {0: 0, 1: 1}
    room.name, room.gravity = model.name, model.gravity
    room.addJoint(0, pin.JointModelFreeFlyer(), model.jointPlacements[1], model.names[1])
    room.appendBodyToJoint(1, model.inertias[1], pin.SE3.Identity())
    for before, name in zip([model.names[1], *order[:-1]], order, strict=True):
        if name.startswith(SPARE):
            # A leaf on what comes before it: Pinocchio wants the joints of a branch side by side.
            parent = room.getJointId(before) if before.startswith(SPARE) or _same_limb(spec, before, name) else 1
            room.addJoint(parent, pin.JointModelRZ(), pin.SE3.Identity(), name)
            continue
        joint = model.getJointId(name)
        parent = place[model.parents[joint]]
        place[joint] = room.addJoint(parent, model.joints[joint], model.jointPlacements[joint], name)
        room.appendBodyToJoint(place[joint], model.inertias[joint], pin.SE3.Identity())
    for frame in list(model.frames)[1:]:
        if frame.type != pin.FrameType.JOINT:
            room.addFrame(pin.Frame(frame.name, place[frame.parentJoint], 0, frame.placement, frame.type), False)
    return room


def real(model: pin.Model) -> np.ndarray:
    """Which joints of a model with room are those of the robot, shape (N_JOINTS,)."""
    return np.array([not name.startswith(SPARE) for name in list(model.names)[2:]])


def _order(spec: RobotSpec, model: pin.Model) -> list[str]:
    """Names of the joints in the optimiser's order, spare ones where the robot has none."""
    names, order = list(model.names)[2:], []
    for limb, most in ROOM.items():
        mine = [name for name in names if name in {spec.joint_names[i] for i in spec.limbs[limb]}]
        if len(mine) > most or (limb.endswith("leg") and len(mine) < most):
            raise InputError(
                f"the optimiser has room for {most} joints of {limb}; {spec.name} has {len(mine)}: {', '.join(mine)}"
            )
        order += [*mine, *(f"{SPARE}_{limb}_{i}" for i in range(len(mine), most))]
    kept = [name for name in order if not name.startswith(SPARE)]
    if kept != names:
        raise InputError(
            f"the optimiser needs legs, waist and arms in this order, {N_BODY} velocities with the base's; the body of "
            f"{spec.name} has {', '.join(names)}"
        )
    return order


def _same_limb(spec: RobotSpec, before: str, name: str) -> bool:
    """Whether a joint is in the limb that a spare one fills up."""
    limb = name.removeprefix(f"{SPARE}_").rpartition("_")[0]
    return before in {spec.joint_names[i] for i in spec.limbs[limb]}
