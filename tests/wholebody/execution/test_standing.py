"""Strategy: how long a robot stands that comes off its plan again and again, on times that the test says."""

from wholebody.execution.standing import AGAIN_WITHIN, Patience


def test_the_first_time_a_chunk_is_joined_at_once():
    assert Patience().wait(5.0) == 0.0


def test_each_time_soon_after_the_last_the_robot_stands_twice_as_long():
    patience, now, waits = Patience(), 0.0, []
    for _ in range(6):
        waits.append(patience.wait(now))
        now += 0.5
    assert waits == [0.0, 0.2, 0.4, 0.8, 1.6, 1.6]


def test_after_a_while_on_its_plan_it_is_as_at_first():
    patience = Patience()
    patience.wait(0.0)
    assert patience.wait(0.5) == 0.2
    assert patience.wait(0.5 + AGAIN_WITHIN) == 0.0
