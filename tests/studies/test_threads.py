"""Two hundred chunks judged by eight threads, against one by one: to the bit."""

import pytest

from tests.support.thread_cases import chunks, in_threads, told


@pytest.mark.regression
@pytest.mark.timeout(0)
def test_two_hundred_chunks_by_eight_threads_are_told_the_same_as_one_by_one():
    cases = chunks(200)
    alone = [told(chunk) for chunk in cases]
    together = in_threads(told, cases, 8)
    assert [k for k in range(len(cases)) if together[k] != alone[k]] == []
