"""A policy that goes wrong at some time, in every way there is, and the latency that goes with it."""

import dataclasses

import numpy as np

from policy.executor.simulated import simulated_executor

FAULTS = {
    "hangs 2 s": "policy_hung",
    "hangs for ever": "policy_hung",
    "raises": "policy_raised",
    "dies": "policy_dead",
    "returns NaN": "chunk_invalid",
    "returns no chunk": "chunk_invalid",
    "changes its spec": "chunk_wrong_spec",
    "forgets the time": "chunk_wrong_time",
    "counts backwards": "chunk_out_of_order",
}
"""Fault and the code that it is reported under."""


class FaultyPolicy:
    """Another policy, until observations from `at` on [s]; a hang is over after one call, the rest goes on."""

    def __init__(self, policy, fault, at, *, latency=0.0):
        self.policy, self.fault, self.at, self.usual = policy, fault, at, latency
        self.spec, self.sees_robot = policy.spec, policy.sees_robot

    def reset(self, task=""):
        self.policy.reset(task)
        self.hung, self.next_latency = False, self.usual

    def latency(self):
        return self.next_latency

    def infer(self, observation):
        chunk, self.next_latency = self.policy.infer(observation), self.usual
        return chunk if observation.time < self.at else self.go_wrong(chunk)

    def go_wrong(self, chunk):
        if self.fault.startswith("hangs"):
            if not self.hung:
                self.hung, self.next_latency = True, 2.0 if self.fault == "hangs 2 s" else np.inf
            return chunk
        if self.fault == "raises":
            raise RuntimeError("out of memory")
        if self.fault == "dies":
            raise SystemExit(1)
        if self.fault == "returns no chunk":
            return {"actions": np.zeros((50, 32))}
        return dataclasses.replace(chunk, **self.changes(chunk))

    def changes(self, chunk):
        if self.fault == "returns NaN":
            T = chunk.T_world_lhand.copy()
            T[7, 0, 3] = np.nan
            return {"T_world_lhand": T}
        if self.fault == "changes its spec":
            return {"spec_id": "joint28"}
        if self.fault == "forgets the time":
            return {"t_obs": chunk.t_obs - 0.5}
        return {"seq": 0}


def executor(policy, **settings):
    """On a simulated clock, with the policy's own latency."""
    return simulated_executor(policy, latency=policy.latency, **settings)
