"""The command line of tools/import: a wrong option is answered with one line, and a pipe that nobody reads any more ends nothing.
Needs tflite, numpy and flatbuffers.

    python3 tests/import/command_line.py"""
import os
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE]

from uses import Bench, IMPORT, network  # noqa: E402


def wrong_options(bench):
    model = network([(1, 20)], "SOFTMAX")
    for text, options in (("--decoder: found 'nosuch', expected one of the names that --help lists", ("--decoder", "nosuch")),
                          ("--fit: found 'round', expected stretch or letterbox", ("--fit", "round")),
                          ("--score: found 'abc', expected a number", ("--score", "abc")),
                          ("--most: found '1.5', expected a whole number", ("--most", "1.5")),
                          ("--score: expected one argument", ("--score",)),
                          ("found '--nosuch', expected options as --help lists them", ("--nosuch",)),
                          ("found '--" + "n" * 58 + "', expected options", ("--" + "n" * 300,)),
                          ("-o m.tflite: found the name of a file to read", ("-o", "m.tflite"))):
        bench.refused(f"options {options[0][:20]}", model, text, *options)
        bench.holds("in 200 characters", len(bench.run(model, *options)[1]) <= 201, True)
    done = started(bench)
    bench.holds("no model", done.stderr, "tools/import: found no model, expected one: tools/import MODEL.tflite; --help lists the options\n")
    listed = started(bench, "--help").stdout
    bench.holds("--help lists the decoders", "yolov8_pose" in listed and "landmarks" in listed, True)


def recuts(bench):
    """--recut of a file that is not there, onto one that is."""
    there = bench.file("there.fvm", "text")
    done = started(bench, "--recut", "0", "nofile.fvm", "-o", there)
    bench.holds("--recut of no file", (done.returncode, done.stderr) == (2, "nofile.fvm: No such file or directory\n"), True)
    done = started(bench, "--recut", "0", there, "-o", there)
    bench.holds("--recut onto itself", (done.returncode, "found that file as -o" in done.stderr), (2, 1))


def started(bench, *options, **keys):
    keys = {"stdout": subprocess.PIPE, **keys}
    return subprocess.run([sys.executable, IMPORT, *options], stderr=subprocess.PIPE, text=True, check=False, cwd=bench.folder, **keys)


def unread(bench):
    """Nobody reads what is printed: the model file is written all the same, and nothing is said of it."""
    bench.file("p.tflite", network([(1, 20)], "SOFTMAX"))
    for buffered in ("", "1"):
        reader, writer = os.pipe()
        os.close(reader)
        done = started(bench, "p.tflite", stdout=writer, env={**os.environ, "PYTHONUNBUFFERED": buffered})
        os.close(writer)
        path = os.path.join(bench.folder, "p.fvm")
        bench.holds(f"a closed pipe, {'' if buffered else 'not '}written at once", (done.returncode, len(done.stderr), os.path.exists(path)), (0, 0, 1))
        os.remove(path)
    with open("/dev/full", "w", encoding="utf-8") as full:
        done = started(bench, "p.tflite", "--names", stdout=full)
    bench.holds("a full disk", (done.returncode, done.stderr) == (2, "standard output: No space left on device\n"), True)


def main():
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(folder)
        for test in (wrong_options, recuts, unread):
            test(bench)
    return 1 if bench.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
