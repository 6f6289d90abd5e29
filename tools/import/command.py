"""The command line: what is wrong with options is said in one line, and whoever stops reading the lines printed ends nothing."""
import argparse
import os
import sys

from graph import ImportProblem

LISTED_MAX = 100  # characters of a list of choices
EXPECTED = {float: "a number", int: "a whole number"}


class Parser(argparse.ArgumentParser):
    """Raises ImportProblem, where argparse prints its usage and ends the program."""

    def error(self, message):
        text = " ".join(message.split()).removeprefix("argument ")
        if text.startswith("unrecognized arguments: "):
            text = f"found {text.removeprefix('unrecognized arguments: ')[:60]!r}, expected options as --help lists them"
        elif text.startswith("the following arguments are required: "):
            text = "found no model, expected one: tools/import MODEL.tflite; --help lists the options"
        raise ImportProblem(text)

    def _get_value(self, action, string):
        try:
            return super()._get_value(action, string)
        except argparse.ArgumentError as problem:
            raise argparse.ArgumentError(action, f"found {string[:40]!r}, expected {EXPECTED.get(action.type, 'another')}") from problem

    def _check_value(self, action, value):
        if action.choices is None or value in action.choices:
            return
        names = " or ".join(str(choice) for choice in action.choices)
        raise argparse.ArgumentError(action, f"found {str(value)[:40]!r}, expected "
                                     f"{names if len(names) <= LISTED_MAX else 'one of the names that --help lists'}")


class OutputProblem(Exception):
    """Lines cannot be written."""


class Output:
    """The standard output. Where nobody reads it any more, the work goes on without a word."""

    def __init__(self, stream):
        self.stream = stream

    def __getattr__(self, name):
        return getattr(self.stream, name)

    def write(self, text):
        return self.attempt(self.stream.write, text)

    def flush(self):
        return self.attempt(self.stream.flush)

    def attempt(self, what, *given):
        try:
            return what(*given)
        except BrokenPipeError:
            self.leave()
            return len(given[0]) if given else None
        except OSError as problem:
            self.leave()
            raise OutputProblem(f"standard output: {problem.strerror}") from problem

    def leave(self):
        """Nothing is written any more, also what is still buffered."""
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, self.stream.fileno())
        os.close(nothing)


def run(main):
    """The program's status; main() gives its own."""
    sys.stdout = Output(sys.stdout)
    try:
        status = main()
        sys.stdout.flush()
    except OutputProblem as problem:
        print(problem, file=sys.stderr)
        return 2
    return status
