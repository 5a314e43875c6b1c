"""Things that serve one thread at a time, made for some settings, and lent to as many threads as processors."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from threading import Condition

from wholebody.errors import WholebodyError
from wholebody.resources import processors


class Lending[Thing]:
    """Makes things on request, lends each to one thread at a time, and keeps it for the next one.

    There are no more of them than processors, for whatever settings: a thread waits until one is given back, and what
    lies idle for other settings makes room.

    Args:
        make: Makes one for some settings; what it does must not depend on what it was used for before.
    """

    def __init__(self, make: Callable[..., Thing]) -> None:
        self._make, self._most = make, max(len(processors()), 1)
        self._idle: list[tuple[Hashable, Thing]] = []
        self._alive, self._changed = 0, Condition()

    @contextmanager
    def lend(self, *settings: Hashable) -> Iterator[Thing]:
        """One for these settings, as long as the ``with`` lasts; waits while all are lent.

        One that failed otherwise than by what it is meant to say is not lent again.
        """
        thing = self._taken(settings)
        try:
            thing = self._make(*settings) if thing is None else thing
            yield thing
        except WholebodyError:
            self._give_back(settings, thing)
            raise
        except BaseException:
            self._give_back(settings, None)
            raise
        else:
            self._give_back(settings, thing)

    def _taken(self, settings: Hashable) -> Thing | None:
        """An idle one, or None where one may be made."""
        with self._changed:
            while True:
                for i in reversed(range(len(self._idle))):
                    if self._idle[i][0] == settings:
                        return self._idle.pop(i)[1]
                if self._alive < self._most:
                    self._alive += 1
                    return None
                if self._idle:
                    del self._idle[0]
                    return None
                self._changed.wait()

    def _give_back(self, settings: Hashable, thing: Thing | None) -> None:
        with self._changed:
            if thing is None:
                self._alive -= 1
            else:
                self._idle.append((settings, thing))
            self._changed.notify()
