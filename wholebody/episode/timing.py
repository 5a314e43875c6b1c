"""Time in an episode, in a few numbers: how late chunks came, how long there was none, and how smoothly they met."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wholebody.episode.result import EpisodeResult


@dataclass(frozen=True, kw_only=True)
class Timing:
    """What an executor and the seams of an episode come to.

    Attributes:
        chunks: Chunks that were executed.
        latency_median_s, latency_max_s: From the observation to the answer [s].
        waited_s: Time before the first chunk [s].
        starved_s, starvations: Time after the end of a chunk without a new one [s], and how often.
        seam_m, seam_rad: Largest jump of a commanded palm where chunks met [m], [rad].
        seam_m_s, seam_rad_s: Largest jump of its velocity [m/s], [rad/s].
    """

    chunks: int = 0
    latency_median_s: float = 0.0
    latency_max_s: float = 0.0
    waited_s: float = 0.0
    starved_s: float = 0.0
    starvations: int = 0
    seam_m: float = 0.0
    seam_rad: float = 0.0
    seam_m_s: float = 0.0
    seam_rad_s: float = 0.0

    def text(self) -> str:
        """One line for people."""
        parts = [f"{self.chunks} executed"]
        if self.latency_max_s > 0.0:
            median, most = 1e3 * self.latency_median_s, 1e3 * self.latency_max_s
            parts.append(f"latency {median:.0f} ms median, {most:.0f} ms at most")
        if self.starvations:
            times = "once" if self.starvations == 1 else f"{self.starvations} times"
            parts.append(f"starved {times}, {self.starved_s:.2f} s")
        turn = np.rad2deg(self.seam_rad)
        return f"{', '.join(parts)}; seam {1e3 * self.seam_m:.3f} mm, {turn:.3f} deg, {self.seam_m_s:.4f} m/s"


def timing(result: EpisodeResult) -> Timing:
    """Timing of an episode; all zero if no chunk came."""
    report, seams = result.execution, result.seams
    if report is None:
        return Timing()
    latencies = report.latencies if report.deliveries else np.zeros(1)
    return Timing(
        chunks=result.executed,
        latency_median_s=float(np.median(latencies)),
        latency_max_s=float(latencies.max()),
        waited_s=report.waited,
        starved_s=report.starved,
        starvations=report.starvations,
        seam_m=max((seam.distance for seam in seams), default=0.0),
        seam_rad=max((seam.angle for seam in seams), default=0.0),
        seam_m_s=max((seam.velocity for seam in seams), default=0.0),
        seam_rad_s=max((seam.angular_velocity for seam in seams), default=0.0),
    )
