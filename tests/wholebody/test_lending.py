"""Strategy: threads that meet where they must, so that a thing that serves two at a time is seen."""

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from wholebody import lending
from wholebody.errors import InputError
from wholebody.lending import Lending


@pytest.fixture
def made(monkeypatch):
    monkeypatch.setattr(lending, "processors", lambda: [0, 1])
    return []


def maker(made):
    def make(name):
        made.append(name)
        return object()

    return make


def test_no_thing_serves_two_threads_and_there_are_no_more_than_processors(made):
    lent, busy, guard = Lending(maker(made)), set(), threading.Lock()

    def use(k):
        with lent.lend("a") as thing:
            with guard:
                assert thing not in busy
                busy.add(thing)
            threading.Event().wait(1e-3)
            with guard:
                busy.remove(thing)
        return k

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(use, range(200))) == list(range(200))
    assert 1 <= len(made) <= 2


def test_one_thread_gets_the_same_again_and_others_make_room(made):
    lent = Lending(maker(made))
    for name in ("a", "a", "b", "b", "a"):
        with lent.lend(name):
            pass
    assert made == ["a", "b"]
    with lent.lend("c"):
        pass
    assert made == ["a", "b", "c"]
    with lent.lend("a"):
        pass
    assert made == ["a", "b", "c"]


def test_what_failed_is_not_lent_again_and_what_refused_an_input_is(made):
    lent = Lending(maker(made))
    for error, again in ((InputError, True), (RuntimeError, False), (KeyboardInterrupt, False)):
        with pytest.raises(error), lent.lend("a") as before:
            raise error("said")
        with lent.lend("a") as after:
            assert (after is before) == again


def test_what_cannot_be_made_takes_no_place(made):
    def refuse(name):
        raise InputError(name)

    lent = Lending(refuse)
    for _ in range(5):
        with pytest.raises(InputError), lent.lend("a"):
            pass
