"""TensorFlow writes to the error stream itself, whatever its log level, where one looks for what this program says."""
import contextlib
import os
import sys
import tempfile


@contextlib.contextmanager
def quiet():
    """What is written to the error stream is kept back, and shown only where what is done fails."""
    sys.stderr.flush()
    kept = os.dup(2)
    with tempfile.TemporaryFile() as said:
        os.dup2(said.fileno(), 2)
        try:
            yield
        except BaseException:
            give_back(kept)
            said.seek(0)
            os.write(2, said.read())
            raise
        give_back(kept)


def give_back(kept):
    sys.stderr.flush()
    os.dup2(kept, 2)
    os.close(kept)
