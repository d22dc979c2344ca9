"""The command line inside the test's own process: fast, and what one command leaves behind is undone."""

from dataclasses import dataclass

import pytest
from click.testing import CliRunner

from shadowbench import plugins
from shadowbench.algorithms import ALGORITHMS
from shadowbench.cli import cli
from shadowbench.errors import InputError


@dataclass
class Finished:
    """How a command ended, and what it said."""

    code: int
    output: str
    errors: str


def call(*arguments) -> Finished:
    """Run the command as `shadowbench.cli.main` does; an exception that `main` would let through is raised."""
    done = CliRunner().invoke(cli, [str(argument) for argument in arguments])
    if isinstance(done.exception, InputError):
        return Finished(2, done.stdout, f"{done.stderr}error: {done.exception}\n")
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return Finished(done.exit_code, done.stdout, done.stderr)


@pytest.fixture
def no_plugins_left():
    """Forget the plug-ins that a test loads."""
    before = dict(ALGORITHMS)
    yield
    ALGORITHMS.clear()
    ALGORITHMS.update(before)
    plugins._unavailable.clear()
    plugins._files.clear()
