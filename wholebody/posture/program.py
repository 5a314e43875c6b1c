"""The plan's least-squares program: all knots linearised, and the step that the linear program asks for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dpbtrf, dpbtrs

from wholebody.config import PosturePlanConfig
from wholebody.posture import assembly_core as core
from wholebody.posture import knots as at
from wholebody.posture import weights
from wholebody.posture.knots import N_BODY, N_FREE, Knots
from wholebody.reference.compiled import compiled

SOFTNESS_MAX = 3.0
"""Of the bounds on configurations: past a joint limit a leg can be straight, and nothing is linear any more."""
REMEASURE = 0.01
"""Motion of a joint up to which measured distances are changed by their derivatives [rad]."""
FIXED = 1e12
"""Holds the first knot where it is."""
ACTIVE_SET_LIMIT = 12
"""Times that the set of violated bounds is guessed anew within one step."""


@dataclass
class Group:
    """Rows of one kind at all knots: values r (K, m), weights w (K, m), derivatives J (K, m, f or 3 f)."""

    r: np.ndarray
    w: np.ndarray
    J: np.ndarray
    sign: np.ndarray | None = None


class Program:
    """A motion of K knots and its terms, linearised.

    Args:
        knots: Terms at single knots.
        dt: Time between knots [s].
        T_palms: Palm poses wanted, shape (K, 2, 4, 4).
        q_fingers: Finger joints, shape (K, n_fingers).
        v_start: Velocity at the first knot, shape (35,).
    """

    def __init__(
        self, knots: Knots, dt: float, T_palms: np.ndarray, q_fingers: np.ndarray, v_start: np.ndarray
    ) -> None:
        self.knots, self.dt, self.T_palms = knots, dt, np.ascontiguousarray(T_palms)
        self.q_fingers, self._start = q_fingers, v_start
        self.K = len(T_palms)
        K, n, f = self.K, N_BODY, N_FREE
        self.N, self.zmp = np.zeros((K, n, f)), np.zeros((K, 2))
        self._palms, self.cost = np.tile(np.eye(4), (K, 2, 1, 1)), np.inf
        self._left, self._right = np.zeros((K, 6, 6)), np.zeros((K, 6, 6))
        self._behind, self._ahead = np.zeros((K + 1, n, f)), np.zeros((K + 1, n, f))
        n_sided = at.EDGES.start + knots.n_edges
        n_motion = at.ZMP_EDGES.start + knots.n_edges
        self._r_position, self._J_position = np.zeros((K, at.N_POSITION)), np.zeros((K, at.N_POSITION, n))
        self._measured_at, self._r_measured = np.tile(knots.q_stance + 9.0, (K, 1)), np.full((K, at.N_DISTANCES), -1.0)
        self._measured_at[:, 3:7] = knots.q_stance[3:7]
        self._r_sided, self._J_sided = np.full((K, n_sided), -1.0), np.zeros((K, n_sided, n))
        self._sign_sided = np.ones((K, n_sided))
        self._r_motion, self._D_motion = np.zeros((K, at.N_MOTION)), np.zeros((3, K, at.N_MOTION, n))
        self._r_bound, self._D_bound = np.zeros((K, n_motion)), np.zeros((3, K, n_motion, n))
        self._sign_bound = np.ones((K, n_motion))

    def fresh(self) -> Program:
        """A program of the same motion problem, not yet linearised; it begins with the distances of this one."""
        other = Program(self.knots, self.dt, self.T_palms, self.q_fingers, self._start)
        other._measured_at = self._measured_at.copy()
        other._r_sided[:, at.DISTANCES] = self._r_sided[:, at.DISTANCES]
        other._J_sided[:, at.DISTANCES] = self._J_sided[:, at.DISTANCES]
        other._r_measured = self._r_measured.copy()
        return other

    def _measure(self, q: np.ndarray, k: int) -> None:
        """Distances at a knot; where little has moved since they were measured, by their derivatives."""
        moved = pin.difference(self.knots.model, self._measured_at[k], q)
        if np.abs(moved[6:]).max() < REMEASURE:
            self._r_sided[k, at.DISTANCES] = self._r_measured[k] + self._J_sided[k, at.DISTANCES] @ moved
            return
        self.knots.near(q, self.q_fingers[k], self._r_sided[k], self._J_sided[k])
        self._measured_at[k], self._r_measured[k] = q, self._r_sided[k, at.DISTANCES]

    def linearise(self, q: np.ndarray) -> None:
        """Evaluate everything at the motion q (K, nq), whose first row is given; puts the feet back in place."""
        knots = self.knots
        for k in range(self.K):
            q[k] = knots.settle(q[k], self.N[k])
            self._palms[k, :, :3, :3], self._palms[k, :, :3, 3] = knots.palms()
            if k:
                knots.position(q[k], self.T_palms[k], self._r_position[k], self._J_position[k])
                knots.bounds(q[k], self._J_position[k], self._r_sided[k], self._J_sided[k], self._sign_sided[k])
                self._measure(q[k], k)
        self.half = self._half_steps(q)
        self.v, self.a = 0.5 * (self.half[:-1] + self.half[1:]), np.diff(self.half, axis=0) / self.dt
        # The first velocity is that at its knot: half a step from the next one.
        self.v[0], self.a[0] = self._start, 2.0 * self.a[0]
        for k in range(self.K):
            quadratic = self._r_motion[k], self._D_motion[:, k]
            sided = self._r_bound[k], self._D_bound[:, k], self._sign_bound[k]
            self.zmp[k] = knots.motion(q[k], self.v[k], self.a[k], quadratic, sided)
        self._reduce()

    def _half_steps(self, q: np.ndarray) -> np.ndarray:
        """Velocity at the first knot and those between the knots, (K + 1, n), at rest after the last."""
        model, half = self.knots.model, np.zeros((self.K + 1, N_BODY))
        half[0] = self._start
        for k in range(1, self.K):
            half[k] = pin.difference(model, q[k - 1], q[k]) / self.dt
            A, B = (pin.SE3(pin.Quaternion(x[3:7]).toRotationMatrix(), x[:3]) for x in (q[k - 1], q[k]))
            M = A.actInv(B)
            J = pin.Jlog6(M)
            self._right[k], self._left[k] = J, J @ M.toActionMatrixInverse()
        return half

    def _reduce(self) -> None:
        N, dt, f = self.N, self.dt, N_FREE
        compiled(core, "half_steps")(N, self._left, self._right, dt, self._behind, self._ahead)
        reduce = compiled(core, "motion_rows")
        K = self.K

        def rows(D: np.ndarray) -> np.ndarray:
            out = np.empty((K, D.shape[2], 3 * f))
            reduce(D[0], D[1], D[2], N, self._behind, self._ahead, dt, out)
            return out

        acceleration, speed = np.empty((K, N_BODY, 3 * f)), np.empty((K, N_BODY, 3 * f))
        compiled(core, "rate_rows")(self._behind, self._ahead, dt, acceleration, speed)
        limits = self.knots
        joints = slice(6, None)
        sign_a, sign_v = np.where(self.a[:, joints] > 0, 1.0, -1.0), np.where(self.half[:-1, joints] > 0, 1.0, -1.0)
        self.groups = {
            "position": Group(self._r_position, None, self._J_position @ N),
            "motion": Group(self._r_motion, None, rows(self._D_motion)),
            "acceleration": Group(self.a, None, acceleration),
            "speed": Group(np.ascontiguousarray(self.half[:-1]), None, speed),
            "sided": Group(self._r_sided, None, self._J_sided @ N, self._sign_sided),
            "bound": Group(self._r_bound, None, rows(self._D_bound), self._sign_bound),
            "most_acceleration": Group(
                self.a[:, joints] - sign_a * limits.acceleration_max, None,
                np.ascontiguousarray(acceleration[:, joints]), sign_a,
            ),
            "most_speed": Group(
                self.half[:-1, joints] - sign_v * limits.speed_max, None,
                np.ascontiguousarray(speed[:, joints]), sign_v,
            ),
        }  # fmt: skip

    def weigh(self, config: PosturePlanConfig, softness: float) -> float:
        """Set the weights and return the cost; the bounds' scales are multiplied by ``softness``."""
        g, K = self.groups, self.K

        def tiled(row: np.ndarray | float, width: int) -> np.ndarray:
            return np.ascontiguousarray(np.broadcast_to(row, (K, width)))

        firm = min(softness, SOFTNESS_MAX) ** -2
        g["position"].w = weights.position(g["position"].r, config)
        g["motion"].w = tiled(weights.motion(config), at.N_MOTION)
        g["acceleration"].w = tiled(config.smoothness**-2, N_BODY)
        g["speed"].w = tiled(weights.speed(config), N_BODY)
        g["sided"].w = tiled(weights.sided(g["sided"].r.shape[1]) * firm, g["sided"].r.shape[1])
        g["bound"].w = tiled(weights.bound(g["bound"].r.shape[1]) / softness**2, g["bound"].r.shape[1])
        g["most_acceleration"].w = tiled((weights.ACCELERATION * softness) ** -2, N_BODY - 6)
        g["most_speed"].w = tiled(weights.SPEED**-2 * firm, N_BODY - 6)
        g["position"].w[0] = g["sided"].w[0] = 0.0
        self.cost = weights.give(g["position"].r[1:], config)
        for group in g.values():
            r = group.r if group.sign is None else np.maximum(group.sign * group.r, 0.0)
            self.cost += float(np.sum(group.w * r**2))
        return self.cost

    def palms(self) -> np.ndarray:
        """Palm poses at the knots, (K, 2, 4, 4)."""
        return self._palms.copy()

    def excess(self) -> np.ndarray:
        """Largest violation of a bound at each knot, in units of its scale, (K,); weighed with softness 1."""
        worst = np.zeros(self.K)
        for group in self.groups.values():
            if group.sign is not None:
                worst = np.maximum(worst, np.max(np.sqrt(group.w) * group.sign * group.r, axis=1))
        return worst

    def prepare(self) -> None:
        """Assemble what does not depend on which bounds are violated."""
        self._base = self._empty()
        for name in ("position", "motion", "acceleration", "speed"):
            self._add(name, self.groups[name].w, *self._base)
        groups, start, self._spans = self.groups.values(), 0, {}
        for name, group in self.groups.items():
            self._spans[name] = slice(start, start + group.r.size)
            start += group.r.size
        self._r, self._w = (np.concatenate([getattr(group, x).ravel() for group in groups]) for x in "rw")
        self._sign = np.concatenate([(np.zeros_like(g.r) if g.sign is None else g.sign).ravel() for g in groups])

    def _empty(self) -> tuple[np.ndarray, np.ndarray]:
        n = self.K * N_FREE
        return np.zeros((3 * N_FREE, n), order="F"), np.zeros(n)

    def _add(self, name: str, w: np.ndarray, band: np.ndarray, g: np.ndarray) -> None:
        group = self.groups[name]
        add = compiled(core, "add_position" if group.J.shape[2] == N_FREE else "add_motion")
        add(group.J, group.r, w, band, g)

    def step(self, damping: float) -> tuple[np.ndarray, float]:
        """The step z (K, N_FREE) of the linearised program, and the decrease of the cost it promises.

        The program is convex and piecewise quadratic: Newton's method with an exact line search.
        """
        extra = damping * (self._base[0][0] + 1.0)
        extra[:N_FREE] = FIXED
        z, along = np.zeros(self.K * N_FREE), np.zeros_like(self._r)
        active = self._sign * self._r > 0.0
        search = compiled(core, "line_search")
        for _ in range(ACTIVE_SET_LIMIT):
            band, g = self._base[0].copy(order="F"), self._base[1].copy()
            for name, span in self._spans.items():
                if self.groups[name].sign is not None and active[span].any():
                    violated = active[span].reshape(self.groups[name].r.shape)
                    self._add(name, self.groups[name].w * violated, band, g)
            band[0] += extra
            factor, info = dpbtrf(band, lower=1, overwrite_ab=1)
            if info:
                raise RuntimeError(
                    f"the posture plan's program is singular at variable {info}: is a scale in planner.posture or "
                    "planner.gentle zero or huge? `wholebody config` prints those that work"
                )
            newton = dpbtrs(factor, -g, lower=1)[0]
            direction, change = newton - z, self._along(newton) - along
            t = search(self._r, self._w, self._sign, along, change, z, direction, extra)
            z, along = z + t * direction, along + t * change
            now = self._sign * (self._r + along) > 0.0
            same, active = np.array_equal(now, active), now
            if same and t > 0.99:
                break
        promise = compiled(core, "cost")
        nothing = np.zeros_like(along)
        return z.reshape(self.K, N_FREE), promise(self._r, self._w, self._sign, nothing) - promise(
            self._r, self._w, self._sign, along
        )

    def _along(self, z: np.ndarray) -> np.ndarray:
        """``J z`` of all groups, one after the other."""
        z, out = z.reshape(self.K, N_FREE), np.empty_like(self._r)
        for name, span in self._spans.items():
            group = self.groups[name]
            kind = "along_position" if group.J.shape[2] == N_FREE else "along_motion"
            compiled(core, kind)(group.J, z, out[span].reshape(group.r.shape))
        return out

    def moved(self, q: np.ndarray, z: np.ndarray) -> np.ndarray:
        """The motion after a step."""
        model, out = self.knots.model, q.copy()
        for k in range(1, self.K):
            out[k] = pin.integrate(model, q[k], self.N[k] @ z[k])
        return out
