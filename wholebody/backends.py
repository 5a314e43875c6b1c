"""Controller backends by name."""

from __future__ import annotations

from models.spec import RobotSpec
from wholebody.config import ControllerConfig
from wholebody.controller import WholeBodyController
from wholebody.errors import InputError

BACKENDS = ("native", "placo")
"""Ours, and placo's `DynamicsSolver`."""


def make_controller(spec: RobotSpec, config: ControllerConfig) -> WholeBodyController:
    """The controller that the configuration names.

    Raises:
        InputError: If there is no such backend.
    """
    if config.backend == "native":
        return WholeBodyController(spec, config)
    if config.backend == "placo":
        # placo takes seconds to load.
        from wholebody.placo_backend import PlacoController

        return PlacoController(spec, config)
    raise InputError(f"unknown controller backend '{config.backend}'; available: {', '.join(BACKENDS)}")
