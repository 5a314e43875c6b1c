"""The first line of a verdict: one sentence that a person can act on, the same wherever a verdict is told."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Protocol

from wholebody.planning.judgement.chunk_margins import AT_START
from wholebody.planning.judgement.limits import OF_NUMBERS, Limit, Margin
from wholebody.types import PalmCause, Reason
from wholebody.verdict.calibration.odds import Odds
from wholebody.verdict.causes import Why, WouldDo
from wholebody.verdict.quantity import at, digits, due, quantity
from wholebody.verdict.violations import ELSEWHERE, Severity, Violation
from wholebody.verdict.why.cause import slow_down
from wholebody.verdict.why.sentence import body, bound_text, change_text, short_change, stands_in_the_way

LINE, NAME_MIN = 160, 12
"""Most characters of the first line, two lines of a terminal, and how many are left for a name [no unit]; chosen."""
LIKELY = 0.5
"""Probability from which a fall is called likely [no unit]; definition."""
CLAUSE_MIN, CLAUSE_MAX = 30, 95
"""Characters from which on what comes before a colon says something by itself, and up to which it is not cut at a
bracket [no unit]; chosen: no joint's name, and what the first line has room for."""
OF_A_HAND = (*ELSEWHERE, PalmCause.ORIENTATION, PalmCause.LOST, PalmCause.LATE)
"""Violations whose subject is a palm, and whose bound is a distance or an angle of it."""
OF_ROWS = Reason.INTO_FLOOR, Reason.NOISY_CHUNK
"""Those that are told by themselves, whatever numbers are exceeded besides."""
BECAUSE: dict[Reason | PalmCause, str] = {
    Reason.OUT_OF_REACH: "out of reach",
    Reason.STEPS_JUMP: "its rows jump",
    Reason.NOISY_CHUNK: "its rows scatter",
    Reason.POSTURE_INFEASIBLE: "no posture there is balanced",
    Reason.INTO_FLOOR: "below the floor",
    PalmCause.LOST: "it loses what it is commanded",
    PalmCause.LATE: "it comes late",
}
"""Why a hand is not where it is asked to be, in words."""
DEPARTURES = {
    Reason.STARVED: "it waits for chunks",
    Reason.FINGER_LIMIT: "fingers only to the end of their range",
    Reason.SELF_CONTACT: "the robot touches itself",
    Reason.SCENE_CONTACT: "into what stands there",
    Reason.TORQUE_LIMIT: "at a motor's limit",
    Reason.HANDS_DROPPED: "the hands gave way to balance",
    Reason.QP_FAILED: "the torques were held for a while",
    PalmCause.WAITING: "slowed down",
}
"""Words for what else a violation did to the input."""


JUDGED_THERE = "judged with the hands at its first row"
"""What a note on where an input begins itself begins with."""


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
    def fps(self) -> float:
        """Rows a second of the input [Hz]."""
        ...

    @property
    def approach_s(self) -> float:
        """Time of the way to the first row [s]."""
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


def headline(verdict: Judged) -> str:
    """What happens, to which hand, at which row, by how much against which bound, why, and what would do.

    It leaves `NAME_MIN` characters of `LINE` to a name; what does not fit is in the lines below (`below`).
    """
    most = LINE - len(f"{verdict.verdict}  : ") - NAME_MIN
    text = f"done as given{_doubt(verdict)}"
    if verdict.verdict == "infeasible":
        text = _infeasible(verdict)
    elif verdict.verdict != "feasible":
        text = _repaired(verdict)
    parts = [one.subject for one in verdict.violations if one.code is Reason.HANDS_ONLY]
    parts += [text, short_would(verdict) or (alone(verdict) if verdict.verdict == "feasible" else "")]
    said = ""
    for part in filter(None, parts):
        said = f"{said}; {part}" if said and len(said) + len(part) + 2 <= most else said or part
    return said if len(said) <= most else said[: most - 2].rpartition(" ")[0].rstrip(",;:") + " …"


def below(verdict: Judged) -> Iterator[str]:
    """Lines below the first: what becomes of the robot with the supervisor and without, and every change."""
    told = "; ".join(part for part in (_supervised(verdict), alone(verdict)) if part)
    if told:
        yield f"  robot    {told}"
    if changes := [change_text(one) for one in verdict.would_do]:
        yield f"  would do {', or '.join(changes)}"


def first_line(verdict: Judged, name: str) -> str:
    """The answer, the end of the input's name and the headline in `LINE` characters."""
    answer, told = verdict.verdict.upper().replace("_", " "), headline(verdict)
    room = LINE - len(answer) - len(told) - 4
    return f"{answer}  {name if len(name) <= room else '…' + name[1 - room :]}: {told}"


def short_would(verdict: Judged) -> str:
    """The first change of the input that would do, in few words."""
    first = next((short_change(one) for one in verdict.would_do if one.bound is None), "")
    return f"would do: {first}" if first else ""


def alone(verdict: Judged) -> str:
    """What would become of it without the supervisor."""
    if verdict.odds is None or verdict.follow == "as_given":
        return ""
    p = verdict.odds.fall_as_given.p
    return f"without the supervisor a fall is likely ({100 * p:.0f} %)" if p >= LIKELY else ""


def _doubt(verdict: Judged) -> str:
    """The first clause of what is odd about the numbers of an input that is done as given."""
    notes = [one.subject for one in verdict.violations if one.code is Reason.CHUNK_NOTE]
    notes.sort(key=lambda text: text.startswith(JUDGED_THERE))  # which is about the check, and no doubt
    if not notes:
        return ""
    cure = re.search(r"(--read-as \w+) reads", notes[0])
    return f", but note: {_clause(notes[0])}{f' ({cure[1]}?)' if cure else ''}"


def _clause(text: str) -> str:
    """The beginning of a sentence, up to where it goes into detail."""
    ends = (m.start() for m in re.finditer(r"; |: ", text))
    whole = (end for end in ends if end >= CLAUSE_MIN and text[:end].count("(") == text[:end].count(")"))
    clause = text[: next(whole, len(text))]
    return clause if len(clause) <= CLAUSE_MAX else clause.partition(" (")[0]


def _infeasible(verdict: Judged) -> str:
    """What is worst, where, by how much, and what stands in the way."""
    first = next((one for one in verdict.violations if one.severity is Severity.INFEASIBLE), None)
    if first is None or first.code is Reason.NO_CHUNK:
        return "it cannot be done" if first is None else "nothing of it was executed"
    place = at(first.time, first.step, verdict.fps)
    if first.code is Reason.FALL:
        return f"the robot falls{place}: {first.subject}"
    if first.code is Reason.REFUSED:
        return f"refused: {first.subject.partition(': ')[2] or first.subject}"
    if first.kind in OF_A_HAND:
        if first.code not in OF_ROWS and (told := _of_numbers(verdict)):
            return told
        return _of_hand(first, verdict, "" if first.code in OF_ROWS else _cause(verdict))
    return _otherwise(first, place)


def _otherwise(one: Violation, place: str) -> str:
    """A violation that is not about a palm."""
    value, bound = quantity(one.value, one.unit), quantity(one.bound, one.unit)
    if one.code is Reason.SCENE_CONTACT:
        inside, _, what = one.subject.partition(" - ")
        deep = quantity(abs(one.value), one.unit)
        return f"{body(inside)} would go {deep} into {body(what) or 'what stands there'}{place}"
    if one.code is Reason.TORQUE_LIMIT:
        return f"the motor of {body(one.subject)} would have to give {value}{place}, {bound} is its limit"
    if one.code is Reason.HAND_FORCE:
        return f"{one.subject} is told to push with {value}{place}, and can with {bound}"
    return f"{one.subject}{place}"


def _of_numbers(verdict: Judged) -> str:
    """The bound on its own numbers that an input exceeds most, where that alone forbids it."""
    if verdict.causes:
        members = verdict.causes[0].members
        over = [one for one in members if one.code in OF_NUMBERS] if len(members) == 1 else []
    else:
        over = [one for one in verdict.margins if one.code in OF_NUMBERS and one.margin < 0.0]
    if not _is_far(verdict):
        over = [one for one in over if one.code is not Limit.START]
    if not over:
        return ""
    one = max(over, key=lambda x: (slow_down(x), -x.share))
    hand = body(one.subject.removesuffix(AT_START)).replace("palm", "hand")
    if one.code is Limit.START:
        value, bound = quantity(one.value, one.unit), quantity(one.bound, one.unit)
        return f"{hand} is {value} from where row 0 begins, {bound} allowed"
    times = one.value / one.bound if slow_down(one) > 1.0 else 0.0
    jumps = " jumps" if any(x.code is Reason.STEPS_JUMP for x in verdict.violations) and times else ""
    said = f"{hand}{jumps} at {due(one.step, verdict.fps)}: {bound_text(one)}"
    return f"{said} ({digits(times, 3)} times)" if times else said


def _is_far(verdict: Judged) -> bool:
    """Whether the way to row 0 is what is wrong: hands are far from later rows where they could not follow, too."""
    begun_there = any(one.kind == "start" for one in verdict.would_do)
    far = any(one.code is Reason.FAR_START and one.unit == "m" for one in verdict.violations)
    return begun_there or (far and verdict.violations[0].code is not Reason.OUT_OF_REACH)


def _cause(verdict: Judged) -> str:
    """What stands in the way, where it was asked why."""
    members: Sequence[Margin] = verdict.causes[0].members if verdict.causes else ()
    return " and ".join(list(dict.fromkeys(map(stands_in_the_way, members)))[:2])


def _of_hand(one: Violation, verdict: Judged, cause: str = "") -> str:
    """A hand that is not where it is asked to be: where, by how much, against which bound, and why."""
    hand = one.subject.replace("palm", "hand")
    value, bound = quantity(one.value, one.unit), quantity(one.bound, one.unit)
    away = f"turned {value} away" if one.unit == "rad" else f"{value} off"
    why = cause or BECAUSE.get(one.cause or one.code, "")
    place = "" if one.step is None else f" at {due(one.step, verdict.fps)}"
    return f"{hand} {away}{place}, {bound} allowed{why and f': {why}'}"


def _repaired(verdict: Judged) -> str:
    """What is done, and in what it is not as given, the worst hand first."""
    worst = [one for one in verdict.violations if one.severity is Severity.REPAIR]
    if any(one.code is Reason.CHANGED_NUMBERS for one in worst):  # which says of fingers where they would go
        worst = [one for one in worst if one.code is not Reason.FINGER_LIMIT]
    if all(one.code is Reason.HANDS_ONLY for one in worst):
        return "the hands do it as given, from where the robot stands"
    # Of a hand, where it is farthest off and where it is turned most: not for each reason anew.
    first = {(one.subject, one.unit) if one.kind in OF_A_HAND else one.code: one for one in reversed(worst)}
    parts = dict.fromkeys(_departure(one, verdict) for one in worst if one.came_of is None and one in first.values())
    hands = [part for part in parts if " hand " in part]
    return "done, but " + (", ".join(dict.fromkeys(part for part in (*hands[:1], *parts) if part)) or "not as given")


def _departure(one: Violation, verdict: Judged) -> str:
    """Departure from what is given, of something that is done."""
    if one.kind in OF_A_HAND:
        return _of_hand(one, verdict).replace("allowed", "is as given")
    if one.code is Reason.TOO_FAST_FOR_BALANCE:
        return f"{quantity(one.value, one.unit)} times slower"
    if one.code is Reason.FAR_START:
        from_hands = f"it begins {quantity(one.value, one.unit)} from the hands"
        return f"{from_hands}, which take {verdict.approach_s:.1f} s to get there" if verdict.approach_s else from_hands
    if one.code is Reason.CHANGED_NUMBERS:
        return _clause(one.subject)
    return DEPARTURES.get(one.kind) or (_clause(one.subject) if one.unit == "s" else "")


def _supervised(verdict: Judged) -> str:
    """What becomes of the robot under the supervisor, where that is not said yet."""
    if verdict.verdict != "infeasible" or verdict.follow == "as_given" or verdict.fell:
        return ""
    if any(one.code in (Reason.REFUSED, Reason.NO_CHUNK) for one in verdict.violations):
        return "with the supervisor it stands where it is"
    return "with the supervisor it stays on its feet and its hands go as near as they can"
