"""Controller backends by name."""

from __future__ import annotations

from models.spec import RobotSpec
from wholebody.backends.kinematic.controller import KinematicController
from wholebody.config import ControllerConfig
from wholebody.control.base import Controller
from wholebody.control.controller import WholeBodyController
from wholebody.errors import InputError

BACKENDS = ("native", "placo", "kinematic")
"""Ours, placo's `DynamicsSolver`, and inverse kinematics without dynamics."""


def make_controller(spec: RobotSpec, config: ControllerConfig) -> Controller:
    """The controller that the configuration names.

    Raises:
        InputError: If there is no such backend.
    """
    if config.backend == "native":
        return WholeBodyController(spec, config)
    if config.backend == "placo":
        # placo takes seconds to load.
        from wholebody.backends.placo.controller import PlacoController

        return PlacoController(spec, config)
    if config.backend == "kinematic":
        return KinematicController(spec, config)
    raise InputError(f"unknown controller backend '{config.backend}'; available: {', '.join(BACKENDS)}")
