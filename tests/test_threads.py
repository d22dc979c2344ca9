import threading
import time

import numpy as np
import pytest

from shadowbench import jit, threads
from tests.counting_example import visit_all


@pytest.mark.parametrize("n_threads", [2, 3, 8])
def test_every_worker_runs_once_in_a_thousand_calls(n_threads):
    jit.set_threads(n_threads)
    for call in range(1000):
        visits = np.zeros(1 + call % 70, np.int64)
        visit_all(visits)
        assert (visits == 1).all()


def test_threads_that_sleep_are_no_obstacle():
    jit.set_threads(4)
    for _ in range(5):
        visits = np.zeros(64, np.int64)
        visit_all(visits)
        assert (visits == 1).all()
        time.sleep(0.05)        # longer than a thread watches for the next call


def test_two_callers_at_once():
    jit.set_threads(2)
    wrong = []

    def call():
        for _ in range(300):
            visits = np.zeros(40, np.int64)
            visit_all(visits)
            if (visits != 1).any():
                wrong.append(visits)

    callers = [threading.Thread(target=call) for _ in range(3)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert not wrong


def test_an_error_in_another_thread_reaches_the_caller():
    team, here = threads.Team(2, jit._spin), threading.current_thread()

    def kernel(numbers, announced, generation, n_workers, n_pieces):
        if threading.current_thread() is not here:
            raise ZeroDivisionError("in another thread")
        announced[threads.GENERATION] = generation
        time.sleep(0.02)        # leaves the pieces to the other

    with pytest.raises(ZeroDivisionError, match="in another thread"):
        team.run(kernel, 4, 4, ())


def test_the_number_of_threads_can_change_between_calls():
    for n_threads in (2, 1, 5, 2):
        jit.set_threads(n_threads)
        visits = np.zeros(33, np.int64)
        visit_all(visits)
        assert (visits == 1).all()


def test_arguments_are_let_go_of_after_the_call():
    team, seen = threads.Team(2, jit._spin), []
    argument = np.zeros(1)

    def kernel(numbers, announced, generation, n_workers, n_pieces, values):
        announced[threads.GENERATION], numbers[threads.DONE] = generation, n_pieces
        seen.append(values is argument)

    team.run(kernel, 4, 4, (argument,))
    assert seen[0] and team._job._rest is None
