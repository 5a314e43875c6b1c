"""The first line of a verdict: one sentence that a person can act on, the same wherever a verdict is told."""

from __future__ import annotations

from typing import Protocol

from wholebody.planning.judgement.limits import OF_NUMBERS, Margin
from wholebody.types import PalmCause, Reason
from wholebody.verdict.calibration.odds import Odds
from wholebody.verdict.causes import Why, WouldDo
from wholebody.verdict.quantity import quantity
from wholebody.verdict.violations import ELSEWHERE, Severity, Violation
from wholebody.verdict.why.sentence import bound_text, change_text

ANOTHER = "which is another motion"
WHY_NOT = {
    Reason.SCENE_CONTACT: "it would go into what stands there",
    Reason.TORQUE_LIMIT: "a motor would have to give {value}",
    Reason.HAND_FORCE: "a hand would have to push with {value}",
    Reason.FALL: "the robot falls",
    Reason.REFUSED: "the input is refused",
    Reason.NO_CHUNK: "nothing of it was executed",
    **dict.fromkeys(ELSEWHERE, f"a hand is moved by {{value}}, {ANOTHER}"),
    Reason.INTO_FLOOR: "a hand would go into the floor, and is moved by {value}",
    PalmCause.ORIENTATION: "a hand is turned by {value}, which is another motion",
    PalmCause.LOST: "the hands lose the motion",
}
DEPARTURES = {
    Reason.TOO_FAST_FOR_BALANCE: "slowed down",
    PalmCause.WAITING: "slowed down",
    **dict.fromkeys(ELSEWHERE, "a hand moved"),
    PalmCause.ORIENTATION: "a hand turned",
    Reason.FAR_START: "it begins elsewhere",
    PalmCause.LATE: "not everywhere on time",
    Reason.STARVED: "it waited for chunks",
    Reason.SCENE_CONTACT: "into what stands there",
    Reason.CHANGED_NUMBERS: "some numbers clipped or not followed",
    Reason.FINGER_LIMIT: "fingers only to the end of their range",
    Reason.SELF_CONTACT: "the robot touches itself",
    Reason.TORQUE_LIMIT: "at a motor's limit",
    Reason.HANDS_DROPPED: "the hands gave way to balance",
    Reason.QP_FAILED: "the torques were held for a while",
}
"""Words for what a violation did to the input."""
LIKELY = 0.5
"""Probability from which a fall is called likely [no unit]; definition."""
OF_A_HAND = (*ELSEWHERE, PalmCause.ORIENTATION, PalmCause.LOST, PalmCause.LATE)
"""Violations whose subject is a palm, and whose bound is a distance or an angle of it."""
BECAUSE = {
    Reason.OUT_OF_REACH: "out of reach",
    Reason.STEPS_JUMP: "its steps jump",
    Reason.NOISY_CHUNK: "its steps scatter",
    Reason.POSTURE_INFEASIBLE: "no posture there is balanced",
    Reason.INTO_FLOOR: "below the floor",
}
"""Why a hand is moved, in words."""


class Judged(Protocol):
    """Parts of a `wholebody.verdict.verdict.Verdict` that its first line needs."""

    @property
    def verdict(self) -> str:
        """Answer."""
        ...

    @property
    def follow(self) -> str:
        """What followed the chunks."""
        ...

    @property
    def fell(self) -> bool:
        """Whether the robot fell in simulation."""
        ...

    @property
    def violations(self) -> list[Violation]:
        """Violations, the worst first."""
        ...

    @property
    def margins(self) -> list[Margin]:
        """Room to each bound, the tightest first."""
        ...

    @property
    def causes(self) -> list[Why]:
        """Bounds that forbid it."""
        ...

    @property
    def would_do(self) -> list[WouldDo]:
        """Changes that would do."""
        ...

    @property
    def odds(self) -> Odds | None:
        """Odds, where they are known."""
        ...


def summary(verdict: Judged) -> str:
    """The answer in a few words."""
    if verdict.verdict == "feasible":
        return "done as given"
    worst = _worst(verdict)
    if verdict.verdict == "infeasible":
        parts = (WHY_NOT[one.kind].format(value=quantity(one.value, one.unit)) for one in worst if one.kind in WHY_NOT)
        return next(parts, "it cannot be done")
    if all(one.code is Reason.HANDS_ONLY for one in worst):
        return "the hands do it as given, from where the robot stands"
    parts = dict.fromkeys(DEPARTURES[one.kind] for one in worst if one.kind in DEPARTURES)
    return "done, but " + (", ".join(parts) or "not as given")


def headline(verdict: Judged) -> str:
    """What happens, to which hand, when, by how much against which bound; what without supervisor; what would do."""
    text, detail = summary(verdict), _detail(verdict)
    hands = [one.subject for one in verdict.violations if one.code is Reason.HANDS_ONLY]
    if detail and verdict.verdict == "feasible_after_repair":
        text = f"{text} ({detail})"
    elif detail:
        text = detail if detail.endswith(ANOTHER) else f"{text}, {detail}"
    return "; ".join(part for part in (*hands, text, _supervised(verdict), _alone(verdict), _would(verdict)) if part)


def _worst(verdict: Judged) -> list[Violation]:
    return [one for one in verdict.violations if one.severity is not Severity.NOTE]


def _detail(verdict: Judged) -> str:
    """Hand, step, bound and by how much: of the cause, or of the worst number, or of the worst violation."""
    worst = _worst(verdict)
    if not worst:
        return ""
    if verdict.verdict == "infeasible":
        if verdict.causes:
            return f"because {verdict.causes[0].text}"
        if (number := _number(verdict.margins)) is not None and worst[0].code is not Reason.INTO_FLOOR:
            return f"because {number}"
    first = worst[0] if verdict.verdict == "infeasible" else next((x for x in worst if x.kind in OF_A_HAND), worst[0])
    return _violation(first)


def _number(margins: list[Margin]) -> str | None:
    """The bound on its own numbers that an input exceeds most."""
    over = [one for one in margins if one.code in OF_NUMBERS and one.margin < 0.0]
    if not over:
        return None
    one = min(over, key=lambda x: x.share)
    times = f", {one.value / one.bound:.3g} times that" if one.bound > 0.0 and one.unit not in ("m", "rad") else ""
    return f"{one.subject} at step {one.step} ({one.time:.2f} s): {bound_text(one)}{times}"


def _violation(one: Violation) -> str:
    when = "" if one.step is None else f" at step {one.step}"
    when += "" if one.time is None else f" ({one.time:.2f} s)"
    if one.kind in OF_A_HAND:
        why = f", {BECAUSE[one.code]}" if one.code in BECAUSE else ""
        away = "off by" if one.code is Reason.PALM_MISSED else "led away by"
        away = "turned away by" if one.unit == "rad" else away
        value, bound = quantity(one.value, one.unit), quantity(one.bound, one.unit)
        another = f", {ANOTHER}" if one.severity is Severity.INFEASIBLE and one.cause is not PalmCause.LOST else ""
        return f"{one.subject}{when} {away} {value} (bound {bound}){why}{another}"
    if one.code is Reason.TOO_FAST_FOR_BALANCE:
        return f"{quantity(one.value, one.unit)} times slower"
    if one.code is Reason.HAND_FORCE:
        return f"{one.subject}{when} is held to {quantity(one.bound, one.unit)} by balance, its arm or its limit"
    return f"{one.subject}{when}" if one.code in (Reason.FALL, Reason.REFUSED, Reason.CHANGED_NUMBERS) else ""


def _supervised(verdict: Judged) -> str:
    """What becomes of the robot under the supervisor, where that is not said yet."""
    if verdict.verdict != "infeasible" or verdict.follow == "as_given" or verdict.fell:
        return ""
    if any(one.code in (Reason.REFUSED, Reason.NO_CHUNK) for one in verdict.violations):
        return "with the supervisor the robot stands where it is"
    return "with the supervisor the robot stays on its feet and the hands go as near as they can"


def _alone(verdict: Judged) -> str:
    """What would become of it without the supervisor."""
    if verdict.odds is None or verdict.follow == "as_given":
        return ""
    p = verdict.odds.fall_as_given.p
    return f"without the supervisor a fall is likely ({100 * p:.0f} %)" if p >= LIKELY else ""


def _would(verdict: Judged) -> str:
    """The changes of the input that would do."""
    changes = [change_text(one) for one in verdict.would_do if one.bound is None]
    return f"it would do {', or '.join(changes)}" if changes else ""
