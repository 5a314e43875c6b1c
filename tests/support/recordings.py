"""Recordings: one made of numbers for those who read and describe, one of the plant for those who draw."""

import numpy as np

from models import g1
from wholebody.sim.plant import MujocoPlant
from wholebody.sim.record import COLUMNS, VERSION, Record
from wholebody.sim.recorder import Followed, Recorder
from wholebody.types import JointCommand, Reason, Status, StatusReport

DT = 0.002
LENGTHS = {"j": 43, "nq": 50, "nv": 49, "m": 43, "k": 1, "c": 4, "d": 2, "s": 1}
SQUARE = np.array([[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]])
"""Corners of both soles [m]: a support polygon."""


def made_record(n=1000, **changed):
    """A robot that stands still in the middle of a square for n periods, palms where they are asked to be."""
    arrays = {}
    for name, column in COLUMNS.items():
        shape = tuple({**LENGTHS, "n": n}.get(length, length) for length in column.shape)
        arrays[name] = np.zeros(shape, dtype={"f": float, "i": int, "U": "U40"}[column.kind])
    names = g1().joint_names
    arrays |= {"time": DT * np.arange(n), "version": np.array(VERSION), "scene": np.array("floor")}
    arrays |= {"soles": np.tile(SQUARE, (n, 1, 1)), "carries": np.ones((n, 4), dtype=int)}
    arrays |= {"joint_names": np.array(sorted(names)), "motor_names": np.array(names), "effort_max": np.full(43, 10.0)}
    arrays["status"][:], arrays["details"][:], arrays["rate"][:] = "tracking", ["", "said"], 1.0
    arrays["q"][:, 6] = arrays["objects"][..., 3] = 1.0
    arrays["pressure_margin"][:] = arrays["capture_margin"][:] = 0.1
    for palms in ("asked", "commanded", "measured"):
        arrays[f"T_world_palms_{palms}"][:] = np.eye(4)
    arrays |= {"palm_bounds": np.array([0.02, 0.05]), "turn_bounds": np.radians([10.0, 25.0]), "lead": np.array(0.1)}
    return Record(arrays | changed)


def stepped_record():
    """A robot that puts its left foot 0.2 m ahead from period 10 to 20, and stands for 30."""
    sole = 0.5 * SQUARE
    soles = np.tile(np.concatenate([sole + np.array([0.0, 0.1]), sole - np.array([0.0, 0.1])]), (30, 1, 1))
    soles[10:, :4, 0] += 0.2
    carries = np.ones((30, 8), dtype=int)
    carries[10:20, :4] = 0
    return made_record(30, soles=soles, carries=carries)


def save(record, path):
    """Write a recording as `Recorder.save` does."""
    np.savez_compressed(path, **record.arrays)
    return path


def plant_recording(path, steps=20, error=0.1):
    """A G1 that holds its stance beside a table, asked from the middle on to have its palms somewhat higher [m]."""
    spec = g1()
    plant, recorder = MujocoPlant(spec, scene="table_cylinder"), Recorder(spec, "table_cylinder")
    state, zero = plant.reset(), np.zeros(spec.n_joints)
    sites = [plant.data.site(tool.palm_frame) for tool in spec.tools]
    commanded = np.tile(np.eye(4), (2, 1, 1))
    for site, T in zip(sites, commanded, strict=True):
        T[:3, :3], T[:3, 3] = site.xmat.reshape(3, 3), site.xpos
    higher = commanded.copy()
    higher[:, 2, 3] += error
    waits = StatusReport(Status.HOLD, Reason.NO_CHUNK, "no chunk yet")
    slowed = StatusReport(Status.SLOWED, Reason.OUT_OF_REACH, "targets moved")
    before, after = Followed(None, commanded, waits), Followed(higher, commanded, slowed, 0.9, 0.03)
    for k in range(steps):
        command = JointCommand(state.time, plant.joint_positions().copy(), zero, zero, spec.kp, spec.kd)
        recorder.add(state, command, before if k < steps // 2 else after, plant)
        state = plant.step(command)
    recorder.save(path)
    return path
