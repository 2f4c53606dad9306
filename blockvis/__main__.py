"""``python -m blockvis``, and what is installed as ``blockvis``: the command line."""

import signal


def script() -> None:
    """Console script: while it is loaded Ctrl-C ends it without a traceback."""
    # In the background of a shell it is ignored, and stays so.
    heard = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if heard:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from .cli import entry

    if heard:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    entry()


if __name__ == "__main__":
    script()
