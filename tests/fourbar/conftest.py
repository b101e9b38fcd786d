"""Command lines of `fourbar`, run in this process in an empty folder."""

from pytest import fixture

from fourbar import cli


@fixture
def run(capsys, tmp_path, monkeypatch):
    """Runs a command: exit status, standard output, standard error."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        code = cli.status([str(argument) for argument in arguments])
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return call


@fixture
def show(run):
    """Runs a command, which must hold, and returns what it prints."""

    def call(*arguments):
        code, out, err = run(*arguments)
        assert (code, err) == (0, "")
        return out

    return call
