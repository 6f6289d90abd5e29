"""How far a tool has come: one line on a terminal, overwritten in place; nothing elsewhere, so that logs stay clean."""
import shutil
import sys
import time

_shown = 0.0


def show(what, done, total, more=""):
    """`done` of `total` steps of `what`; at most five times a second, and always the last."""
    global _shown
    now = time.monotonic()
    if not sys.stderr.isatty() or (now - _shown < 0.2 and done < total):
        return
    _shown = now
    percent = f"  {100 * done / total:.0f} %" if total else ""
    line = f"{what}  {done}/{total}{percent}{'  ' if more else ''}{more}"
    sys.stderr.write("\r\033[K" + line[:shutil.get_terminal_size().columns - 1])
    sys.stderr.flush()


def clear():
    """Before a line is printed, and at the end."""
    if sys.stderr.isatty():
        sys.stderr.write("\r\033[K")
        sys.stderr.flush()
