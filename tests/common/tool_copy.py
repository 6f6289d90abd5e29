"""A program in Python, run in a copy of the process of a test."""
import os
import runpy
import subprocess
import sys
import tempfile


def run_copy(tool, *arguments):
    """What a start of its own gives, but packages that the test has read are there: reading them takes longer than most of what is tested."""
    with tempfile.TemporaryFile("w+") as said, tempfile.TemporaryFile("w+") as complained:
        sys.stdout.flush()
        child = os.fork()
        if child == 0:
            os.dup2(said.fileno(), 1)
            os.dup2(complained.fileno(), 2)
            sys.argv = [tool, *arguments]
            runpy.run_path(tool, run_name="__main__")
            sys.exit(0)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        for file in (said, complained):
            file.seek(0)
        return subprocess.CompletedProcess(arguments, status, said.read(), complained.read())
